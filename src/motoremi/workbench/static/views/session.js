// The view Session: measurement and model for each termination, magnitude and phase (or R and X), and the error.

import { get, post, sessionPath, within } from "../api.js";
import { button, card, facts, h, table } from "../dom.js";
import { exportCard } from "../exports.js";
import { Plots } from "../plot.js";
import { term } from "../terms.js";
import { percent, show, symbols, when } from "../units.js";

const UNITS = { ohm: "|Z| in Ω and phase", decibel: "|Z| in dBΩ and phase", cartesian: "R and X in Ω" };
let units = "ohm";

export const session = {
  title: "Session",

  async load(page) {
    const curves = page.head.sweeps.length ? await get(sessionPath(page.session, "/curves")) : { model: false, sweeps: [] };
    return { head: page.head, curves };
  },

  draw(where, { head, curves }, page) {
    const choice = h("select", { id: "units", value: units, onchange: (event) => { units = event.target.value; page.redraw(true); } },
      Object.entries(UNITS).map(([key, text]) => h("option", { value: key, selected: key === units }, text)));
    const resume = head.resumable && button("Resume this run", () => resumeRun(page), { class: "main" });
    const measuring = head.state === "measuring";
    where.append(h("div", { class: "row" },
      h("label", {}, "Units ", choice),
      resume,
      measuring && h("p", { id: "measuring" }, "This session is being measured. The data so far are shown here, the run itself in the view Bench.")));
    const columns = h("div", { class: "columns" });
    where.append(columns);
    for (const sweep of curves.sweeps) {
      const box = card(`${sweep.termination}-circuit sweep`, h("p", { class: "note" }, term(sweep.termination, "what it shows"), `; ${sweep.points} points`));
      columns.append(box);
      const frames = (data) => framesOf(data.sweeps.find((one) => one.termination === sweep.termination), data);
      const more = (span) => page.attempt(async () => frames(await get(within(sessionPath(head.id, "/curves"), span))));
      new Plots(box).draw(frames(curves), sweep.points > sweep.frequency_hz.length && more);
    }
    if (!curves.sweeps.length) columns.append(h("p", { class: "empty" }, "No impedance sweep in this session."));
    const below = h("div", { class: "packed" });
    where.append(below);
    if (head.ladder.length) below.append(model(head));
    below.append(identity(head), measurements(head, page));
    if (!measuring) below.append(exportCard(page));
    page.viewKey = (event) => {
      if (event.key.toLowerCase() !== "u") return;
      const names = Object.keys(UNITS);
      units = names[(names.indexOf(units) + 1) % names.length];
      page.redraw(true);
    };
  },
};

export function resumeRun(page) {
  page.resume = { session: page.session, bench: page.head.start.backend === "sim" ? "simulated" : "real" };
  page.go("bench");
}

function framesOf(sweep, { model: hasModel, tolerance }) {
  const frames = [], x = sweep.frequency_hz;
  const measured = complexParts(sweep.real, sweep.imag);
  const model = hasModel ? complexParts(sweep.model_real, sweep.model_imag) : null;
  const pair = (label, key) => [
    { label: `measured ${label}`, values: measured[key], color: "--measured", points: x.length <= 1000 },
    ...(model ? [{ label: `model ${label}`, values: model[key], color: "--model" }] : []),
  ];
  if (units === "cartesian") {
    frames.push(["resistance R", x, pair("R", "real"), { unit: "Ω" }], ["reactance X", x, pair("X", "imag"), { unit: "Ω" }]);
  } else {
    if (units === "ohm") frames.push(["magnitude |Z|", x, pair("|Z|", "magnitude"), { unit: "Ω", log: true }]);
    else frames.push(["magnitude |Z| in dBΩ", x, pair("|Z|", "decibel"), { unit: "dBΩ" }]);
    frames.push(["phase", x, pair("phase", "phase"), { unit: "°", height: 180 }]);
  }
  if (hasModel) frames.push(["error against the uncertainty", x, errorSeries(sweep, tolerance), { unit: "%", log: true, height: 170, digits: 3 }]);
  return frames;
}

export function errorSeries(sweep, tolerance) {
  return [
    { label: "error", values: sweep.error_percent.map((value) => Math.max(value, 1e-6)), color: "--model" },
    { label: "uncertainty", values: sweep.uncertainty_percent, color: "--other", dash: [6, 4] },
    ...(tolerance.error_percent === null ? [] : [{ label: "tolerance", values: sweep.frequency_hz.map(() => tolerance.error_percent), color: "--limit", dash: [2, 4] }]),
  ];
}

function complexParts(real, imag) {
  const magnitude = real.map((value, index) => Math.hypot(value, imag[index]));
  return {
    real, imag, magnitude, decibel: magnitude.map((value) => 20 * Math.log10(value)),
    phase: real.map((value, index) => (Math.atan2(imag[index], value) * 180) / Math.PI),
  };
}

function model(head) {
  const top = head.ladder.at(-1);
  return card("Model",
    h("p", {}, term("rms error"), " ", h("span", { class: "large" }, percent(top.rms_error_percent)), " beside ", term("noise and analyser"), ` ${percent(top.floor_percent)}, `, term("chi2"), ` ${show(top.chi2_reduced, "", 3)}`),
    top.beside.map((text) => h("p", {}, text)),
    !top.converged && h("p", { class: "bad" }, "The fit did not converge: do not use its values."),
    table(["parameter", "value", "error bar"], top.parameters.map((one) => [one.name, symbols(one.value), one.bar])),
    top.warnings.map((text) => h("p", { class: "note" }, text)));
}

function identity(head) {
  const rows = [["motor", head.start.motor || "not named"], ["title", head.start.title], ["operator", head.start.operator], ["began", when(head.start.time, true)],
    ["status", head.state === "measuring" ? "measuring" : head.interrupted && head.status !== "interrupted" ? `${head.status}, not closed` : head.status], ["software", head.start.software]];
  return card("Session",
    facts(rows.filter(([, value]) => value)),
    head.instruments.length > 0 && h("h3", {}, "Instruments"),
    head.instruments.length > 0 && table(["role", "instrument", "address"], head.instruments.map((one) => [one.role, Object.values(one.identity).join(" "), one.resource])));
}

// What was measured; each of it can be withdrawn from all analyses, with a reason, and used again.
function measurements(head, page) {
  const used = [...[...head.sweeps, ...head.conditioned].map((one) => [one.name, `${one.termination} sweep: ${one.summary}`]), ...head.values.map((one) => [one.name, one.summary]),
    ...head.spectra.map((one) => [one.name, `${one.detector}, ${one.condition}: ${one.summary}`])];
  if (!used.length && !head.withdrawn.length) return "";
  const fixed = head.state === "measuring" || head.resumable, why = h("input", { id: "withdraw-why", required: true, size: 40 });
  const change = (body) => page.work("changing the session", async () => {
    const done = await post(sessionPath(head.id, "/withdraw"), body);
    if (done.emptied_ladder) page.complain("The models were fitted to other data and are removed: fit this session again.", "note");
    if (done.discarded) page.complain("Verdict, models and diagnosis of the spectra were of other spectra and are removed.", "note");
    return done;
  });
  const form = h("form", { id: "withdraw", hidden: true, onsubmit: (event) => { event.preventDefault(); change({ names: [form.dataset.name], why: why.value }); } },
    h("label", {}, h("span", {}), why), " ", h("button", { type: "submit" }, "Withdraw"), " ", button("Cancel", () => { form.hidden = true; }));
  const ask = (name) => {
    form.dataset.name = name;
    form.querySelector("span").textContent = `Why ${name} is not to be used (the report gives the reason) `;
    form.hidden = false;
    why.focus();
  };
  const rows = used.map(([name, extent]) => [name, symbols(extent), fixed ? "" : button("Withdraw", () => ask(name), { "aria-label": `Withdraw ${name}` })]);
  return card("Measured",
    rows.length > 0 && table(["measurement", "extent", "change"], rows),
    form,
    head.withdrawn.length > 0 && h("h3", {}, "Withdrawn: kept in the session, used by no analysis"),
    head.withdrawn.length > 0 && table(["measurement", "why", "change"], head.withdrawn.map((one) => [one.name, one.why, fixed ? "" : button("Use again", () => change({ names: [one.name], restore: true }), { "aria-label": `Use ${one.name} again` })])));
}
