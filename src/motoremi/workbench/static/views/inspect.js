// The view Inspect: what one element would have to be at each frequency for the model to be exact.

import { get, sessionPath, within } from "../api.js";
import { card, h } from "../dom.js";
import { Plots } from "../plot.js";
import { term } from "../terms.js";
import { symbols } from "../units.js";

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

  draw(where, data, page) {
    const choice = h("select", { id: "element", onchange: (event) => { element = event.target.value; page.redraw(true); } },
      page.head.elements.map((name) => h("option", { value: name, selected: name === element }, name)));
    where.append(h("div", { class: "row" }, h("label", {}, "Element ", choice), h("span", {}, term("inspect", "what this shows"))));
    const columns = h("div", { class: "columns" });
    where.append(columns);
    for (const sweep of data.sweeps) {
      const box = card(`${data.element} as the ${sweep.sweep}-circuit sweep requires it`, h("p", {}, symbols(sweep.reading)));
      columns.append(box);
      const frames = ({ sweeps, unit }) => framesOf(sweeps.find((one) => one.sweep === sweep.sweep), unit);
      const more = (span) => page.attempt(async () => frames(await get(within(sessionPath(page.session, `/inspect?element=${encodeURIComponent(data.element)}`), span))));
      new Plots(box).draw(frames(data), sweep.points > sweep.frequency_hz.length && more);
    }
    where.append(card("In words", h("pre", { class: "text", tabindex: 0, "aria-label": "The inspection in words" }, symbols(data.lines.join("\n")))));
  },
};

function framesOf(sweep, elementUnit) {
  const [first, second, unit, secondUnit] = KINDS[elementUnit] ?? KINDS[1], x = sweep.frequency_hz, lossy = elementUnit === "H" || elementUnit === "F";
  const ratio = (imag, real) => imag.map((value, index) => (value === null || real[index] === null ? null : -value / real[index]));
  const edge = (values, sign, scale) => values.map((value, index) => (value === null || sweep.sigma[index] === null ? null : value + sign * 2 * (scale ? Math.abs(sweep.sigma[index] / scale[index]) : sweep.sigma[index])));
  const losses = lossy ? ratio(sweep.imag, sweep.real) : sweep.imag;
  const series = (needed, scale, has, law) => [
    { label: "", values: edge(needed, 1, scale), color: "--band", band: true }, { label: "", values: edge(needed, -1, scale), color: "--band" },
    { label: "needed", values: needed, color: "--measured" }, { label: "model", values: has, color: "--model", dash: [6, 4] },
    ...(law ? [{ label: sweep.law_name, values: law, color: "--other", dash: [2, 3] }] : []),
  ];
  return [
    [first, x, series(sweep.real, null, sweep.model_real, sweep.law_real), { unit }],
    [second, x, series(losses, lossy ? sweep.real : null, lossy ? ratio(sweep.model_imag, sweep.model_real) : sweep.model_imag, sweep.law_real && (lossy ? ratio(sweep.law_imag, sweep.law_real) : sweep.law_imag)), { unit: secondUnit, height: 180 }],
  ];
}
