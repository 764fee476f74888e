// The view Emission: measured spectra and background, with prediction and limit where there are any.

import { get, post, sessionPath, within } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { Plots } from "../plot.js";
import { term } from "../terms.js";
import { band, show, symbols } from "../units.js";

/* global uPlot */

export const emission = {
  title: "Emission",
  load: (page) => get(sessionPath(page.session, "/emission")),

  draw(where, data, page) {
    const { spectra, prediction } = data;
    const limit = h("select", { id: "limit" }, Object.entries(data.limits).map(([name, title]) => h("option", { value: name, selected: name === data.limit }, title)));
    if (spectra.length && (page.head.ladder.length || !data.modelled)) {
      where.append(h("div", { class: "row" }, h("label", {}, term("limit", "Limit"), " ", limit), button(data.modelled ? (prediction ? "Predict again" : "Predict from the fitted motor") : "Judge against the limit", () => predict(page, limit.value), { class: "main", id: "predict" })));
    }
    if (!spectra.length) where.append(h("p", { class: "empty" }, "No spectrum in this session: run 'emission only' or the full motor test (view Bench)."));
    const columns = h("div", { class: "columns" });
    where.append(columns);
    for (const detector of [...new Set(spectra.map((one) => one.detector))]) {
      const own = spectra.filter((one) => one.detector === detector);
      const box = card("", ...own.map((one) => h("p", { class: "note" }, `${placeOf(one)}: ${symbols(one.summary)}`, one.overload > 0 && h("span", { class: "bad" }, ` ${one.overload} points overloaded`))));
      box.firstChild.append(term(detector, `${detector} detector`));
      columns.append(box);
      const more = (span) => page.attempt(async () => frames(await get(within(sessionPath(page.session, "/emission"), span)), detector));
      new Plots(box).draw(frames(data, detector), own.some((one) => one.points > one.frequency_hz.length) && more);
    }
    if (prediction) where.append(verdict(prediction));
  },
};

// Condition, line of the LISN and operating state of a spectrum.
const placeOf = (one) => [one.condition, one.line && `line ${one.line}`, one.operating].filter(Boolean).join(", ");

function frames({ spectra, prediction }, detector) {
  const own = spectra.filter((one) => one.detector === detector), places = [...new Set(own.filter((one) => !one.background).map(placeOf))];
  // Each line of the LISN and operating state has a colour; beyond two they alternate, and the caption tells them apart.
  const color = (one) => (one.background ? "--soft" : ["--measured", "--other"][places.indexOf(placeOf(one)) % 2]);
  const lines = own.map((one) => ({ x: one.frequency_hz, values: one.level_dbuv, label: placeOf(one), color: color(one), width: 1 }));
  const predicted = prediction?.predicted_dbuv?.[detector];
  if (predicted) lines.push({ x: prediction.frequency_hz, values: predicted, label: "predicted", color: "--model" });
  for (const [label, values, dash] of limits(prediction, detector)) lines.push({ x: prediction.frequency_hz, values, label, color: "--limit", dash });
  // Spectra may have different frequencies.
  const [x, ...values] = uPlot.join(lines.map((one) => [one.x, one.values]));
  return [["level", x, lines.map((one, index) => ({ ...one, values: values[index] })), { unit: "dBµV", height: 300 }]];
}

// Peak levels are judged against the limits of the other detectors: levels below those limits pass.
function limits(prediction, detector) {
  const known = prediction?.limit_dbuv ?? {};
  if (known[detector]) return [["limit", known[detector], [8, 4]]];
  return detector === "peak" ? Object.entries(known).map(([name, values], index) => [`${name} limit`, values, index ? [2, 4] : [8, 4]]) : [];
}

function verdict(prediction) {
  const { judged = [], reasons = [], error_bands: bands = [], remarks = [] } = prediction;
  const levels = (one) => [one.detector, one.conductor && `line ${one.conductor}`, one.operating].filter(Boolean).join(", ");
  return card("Verdict",
    h("p", { id: "limit-verdict", class: prediction.verdict === "pass" ? "large good" : "large bad" }, String(prediction.verdict).toUpperCase()),
    h("p", {}, `The ${prediction.judged_what ?? "measured"} levels, judged against ${prediction.limit?.title ?? "the limit"}.`),
    reasons.map((text) => h("p", { class: "reason" }, text)),
    judged.map((one) => h("p", {}, `${levels(one)}: ${one.verdict ?? "no verdict"}, ${one.why}`)),
    bands.length > 0 && table(["detector", "band", "measured minus predicted, mean", "rms"], bands.map((one) => [one.detector, band(...one.band_hz), show(one.mean_error_db, "dB", 3), show(one.rms_error_db, "dB", 3)])),
    remarks.map((text) => h("p", { class: "note" }, text)));
}

async function predict(page, limit) {
  await page.work("predicting the spectrum", () => post(sessionPath(page.session, "/predict"), { limit }));
}
