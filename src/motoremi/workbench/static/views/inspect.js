// What one element would have to be, at each frequency, for the model to be exact.

import { get, sessionPath } from "../api.js";
import { card, h } from "../dom.js";
import { Plots } from "../plot.js";
import { term } from "../terms.js";

const KINDS = {
  H: ["inductance", "loss tangent", "H", ""], F: ["capacitance", "loss tangent", "F", ""], Ohm: ["resistance", "reactance", "Ω", "Ω"],
  S: ["conductance", "susceptance", "S", "S"], s: ["delay", "imaginary part", "s", "s"], 1: ["factor, real part", "factor, imaginary part", "", ""],
};
let element = "La";

export const inspect = {
  title: "Inspect",
  needs: "model",
  without: "Inspection needs a fitted model: fit this session first (view Story).",

  async load(page) {
    if (!page.head.elements.includes(element)) element = "La";
    return get(sessionPath(page.session, `/inspect?element=${encodeURIComponent(element)}`));
  },

  draw(where, told, page) {
    const choice = h("select", { id: "element", onchange: (event) => { element = event.target.value; page.redraw(true); } },
      page.head.elements.map((name) => h("option", { value: name, selected: name === element }, name)));
    where.append(h("div", { class: "row" }, h("label", {}, "Element ", choice), h("span", {}, term("inspect", "what this shows"))));
    const columns = h("div", { class: "columns" });
    where.append(columns);
    const [first, second, unit, secondUnit] = KINDS[told.unit] ?? KINDS[1];
    for (const sweep of told.sweeps) {
      const box = card(`${told.element} as the ${sweep.sweep}-circuit sweep wants it`, h("p", {}, sweep.reading));
      columns.append(box);
      const plots = new Plots(box), x = sweep.frequency_hz, lossy = told.unit === "H" || told.unit === "F";
      const ratio = (imag, real) => imag.map((value, index) => (value === null || real[index] === null ? null : -value / real[index]));
      const edge = (values, sign, scale) => values.map((value, index) => (value === null || sweep.sigma[index] === null ? null : value + sign * 2 * (scale ? Math.abs(sweep.sigma[index] / scale[index]) : sweep.sigma[index])));
      const losses = lossy ? ratio(sweep.imag, sweep.real) : sweep.imag;
      const series = (needed, scale, has, law) => [
        { label: "", values: edge(needed, 1, scale), color: "--band", band: true }, { label: "", values: edge(needed, -1, scale), color: "--band" },
        { label: "needed", values: needed, color: "--measured" }, { label: "model", values: has, color: "--model", dash: [6, 4] },
        ...(law ? [{ label: sweep.law_name, values: law, color: "--other", dash: [2, 3] }] : []),
      ];
      plots.add(first, x, series(sweep.real, null, sweep.model_real, sweep.law_real), { unit });
      plots.add(second, x, series(losses, lossy ? sweep.real : null, lossy ? ratio(sweep.model_imag, sweep.model_real) : sweep.model_imag, sweep.law_real && (lossy ? ratio(sweep.law_imag, sweep.law_real) : sweep.law_imag)), { unit: secondUnit, height: 180 });
    }
    where.append(card("In words", h("pre", { class: "text", tabindex: 0, "aria-label": "The inspection in words" }, told.lines.join("\n"))));
  },
};
