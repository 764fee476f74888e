// The view Fails: the error of each band and the spans that contribute most; a click zooms to a span.

import { get, post, sessionPath, within } from "../api.js";
import { brief, card, h, table } from "../dom.js";
import { Plots } from "../plot.js";
import { term } from "../terms.js";
import { percent, share, show } from "../units.js";
import { errorSeries } from "./session.js";

export const fails = {
  title: "Fails",
  needs: "model",
  without: "There is no model to compare with the measurement yet: fit this session first (view Story).",

  async load(page) {
    const data = await get(sessionPath(page.session, "/fails"));
    return { data, curves: await get(sessionPath(page.session, "/curves")) };
  },

  draw(where, { data, curves }, page) {
    const plots = {};
    const zoom = (entry) => {
      plots[entry.sweep].span(...entry.band_hz);
      plots[entry.sweep].host.scrollIntoView({ block: "nearest" });
    };
    const row = (entry, cells) => {
      const act = () => zoom(entry);
      return h("tr", { class: "choice", tabindex: 0, onclick: act, onkeydown: (event) => { if (event.key === "Enter") act(); } },
        cells.map((cell) => h("td", { class: brief(cell) }, cell)));
    };
    const verdict = (text) => h("span", { class: text === "pass" ? "good" : "bad" }, text === "pass" ? "PASS" : "FAIL");
    const columns = h("div", { class: "columns" }), passes = data.verdict === "pass";
    where.append(
      h("div", { class: "columns wide-columns" },
        card("Where it fails most", data.where.length > 0 && h("p", { class: "note" }, "A click shows the span in the plot below."),
          data.where.length
            ? table(["sweep", "span", term("share", "share of the squared error"), term("rms error")], data.where.map((one) => row(one, [one.sweep, one.band, share(one.share), percent(one.rms_error_percent)])), { id: "where" })
            : h("p", { class: "good" }, "Nowhere beyond the measurement's uncertainty.")),
        card("Error per band", h("p", {}, verdict(data.verdict), passes ? " within the " : " beyond the ", term("tolerance"), ` of ${tolerance(data.tolerance)}${passes ? ", or within the measurement's uncertainty, at every point" : " and beyond the measurement's uncertainty, in the bands marked below"}`),
          table(["sweep", "band", "verdict", "rms", "largest", "dB", "degrees"], data.bands.map((one) => row(one, [one.sweep, one.band, verdict(one.verdict), percent(one.rms_error_percent), percent(one.max_error_percent), show(one.max_error_db, "dB", 3), show(one.max_phase_deg, "°", 3)])), { id: "bands" }),
          judge(data, page))),
      columns);
    for (const sweep of curves.sweeps) {
      const box = card(`${sweep.termination}-circuit sweep`);
      columns.append(box);
      plots[sweep.termination] = new Plots(box);
      const frames = ({ sweeps }) => framesOf(sweeps.find((one) => one.termination === sweep.termination), data.tolerance);
      const more = (span) => page.attempt(async () => frames(await get(within(sessionPath(page.session, "/curves"), span))));
      plots[sweep.termination].draw(frames(curves), sweep.points > sweep.frequency_hz.length && more);
    }
  },
};

// The error with the points that fail; magnitude and phase separately where they have a tolerance.
function framesOf(sweep, limits) {
  const x = sweep.frequency_hz, failing = sweep.error_percent.map((value, index) => (sweep.fails[index] ? value : null));
  const frames = [["error", x, [...errorSeries(sweep, limits), { label: "fails", values: failing, color: "--bad", points: true }], { unit: "%", log: true, height: 260, digits: 3 }]];
  const judged = (title, values, limit, unit) => frames.push([title, x, [
    { label: "error", values, color: "--model" },
    { label: "tolerance", values: x.map(() => limit), color: "--limit", dash: [2, 4] }, { label: "", values: x.map(() => -limit), color: "--limit", dash: [2, 4] },
  ], { unit, height: 170, digits: 3 }]);
  const magnitude = x.map((_, at) => 20 * Math.log10(Math.hypot(sweep.model_real[at], sweep.model_imag[at]) / Math.hypot(sweep.real[at], sweep.imag[at])));
  const angle = (real, imag, at) => Math.atan2(imag[at], real[at]) * 180 / Math.PI;
  const phase = x.map((_, at) => (((angle(sweep.model_real, sweep.model_imag, at) - angle(sweep.real, sweep.imag, at) + 540) % 360) + 360) % 360 - 180);
  if (limits.magnitude_db !== null) judged("magnitude, model against measured", magnitude, limits.magnitude_db, "dB");
  if (limits.phase_deg !== null) judged("phase, model against measured", phase, limits.phase_deg, "°");
  return frames;
}

function tolerance(limits) {
  const parts = [[limits.error_percent, "% error"], [limits.magnitude_db, "dB"], [limits.phase_deg, "degrees"]];
  return parts.filter(([value]) => value !== null).map(([value, unit]) => `${value} ${unit}`).join(", ");
}

function judge(data, page) {
  const input = h("input", { type: "number", min: "0", step: "any", id: "tolerance", value: data.tolerance.error_percent ?? "" });
  const submit = (event) => {
    event.preventDefault();
    page.work("judging", () => post(sessionPath(page.session, "/judge"), { error_percent: Number(input.value) }));
  };
  return h("form", { class: "row", onsubmit: submit }, h("label", {}, "Tolerance in % ", input), h("button", { type: "submit" }, "Judge"));
}
