// Several sessions side by side: overlays, and the same tables as their report has; each against the first.

import { get } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { save } from "../exports.js";
import { Plots } from "../plot.js";
import { symbols } from "../units.js";

/* global uPlot */

// Which sessions are compared outlives a reload, in this tab.
const CHOSEN = "motoremi-together";
// As many as can be told apart, with and without colour.
const LOOKS = [
  { color: "--measured" }, { color: "--model", dash: [8, 4] }, { color: "--other", dash: [12, 3, 2, 3] }, { color: "--fourth", dash: [2, 3] },
  { color: "--third" }, { color: "--bad", dash: [8, 4] }, { color: "--accent", dash: [12, 3, 2, 3] }, { color: "--soft", dash: [2, 3] },
];

const FILES = ["comparison.html", "comparison.pdf", "comparison.csv", "comparison.json"];

const chosen = () => JSON.parse(sessionStorage.getItem(CHOSEN)) ?? [];
const address = (file = "") => `/api/together${file}?${new URLSearchParams(chosen().map((one) => ["session", one]))}`;

export function compare(sessions, page) {
  sessionStorage.setItem(CHOSEN, JSON.stringify(sessions));
  if (location.hash === "#together") page.redraw();
  else page.go("together");
}

export const together = {
  title: "Compare",
  key: "C",

  load: () => (chosen().length < 2 ? null : get(address())),

  draw(where, told, page) {
    if (!told) {
      where.append(h("p", { class: "empty" }, "Choose two or more sessions in the list of the view Files."));
      return;
    }
    where.append(card("Verdicts", h("p", { class: "note" }, `Held against ${told.names[0]}.`), drawn(told.verdicts, "together-verdicts"),
      h("div", { class: "row" }, "As a report: ", FILES.map((name) => button(name, () => page.work(`writing ${name}`, () => save(address(`/${name}`), name)), { "data-export": name })))));
    const columns = h("div", { class: "columns" });
    where.append(columns);
    for (const termination of ["short", "open"]) drawSweeps(columns, told, termination);
    drawSpectra(columns, told);
    if (told.parameters) where.append(card(told.parameters.title, told.parameters.texts.map((text) => h("p", { class: "note" }, text)), drawn(told.parameters, "together-parameters")));
    if (told.bands) where.append(card(told.bands.title, drawn(told.bands, "together-bands")));
  },
};

function drawn({ title, columns, rows, marked }, id) {
  const mood = { PASS: "good", FAIL: "bad" };
  const box = table(columns, rows.map((row, index) => h("tr", marked.includes(index) ? { class: "marked" } : {},
    row.map((cell, column) => (column === 0 ? h("th", { scope: "row" }, cell) : h("td", { class: mood[cell] }, symbols(cell)))))), { id });
  // Wider than a telephone: it can be scrolled by keys.
  for (const [name, value] of Object.entries({ tabindex: 0, role: "region", "aria-label": title })) box.setAttribute(name, value);
  return box;
}

// Every session has its own look, whatever else it holds.
const look = (told, name) => LOOKS[told.names.indexOf(name)];

function drawSweeps(where, told, termination) {
  const own = (lists) => Object.entries(lists).flatMap(([name, all]) => all.filter((one) => one.termination === termination).map((one) => ({ name, one })));
  const sweeps = own(told.sweeps), changes = own(told.changes);
  if (!sweeps.length) return;
  const box = card(`${termination}-circuit sweep`);
  where.append(box);
  const plots = new Plots(box);
  joined(plots, "magnitude |Z|", sweeps.map(({ name, one }) => ({ x: one.frequency_hz, values: one.magnitude_ohm, label: name, ...look(told, name) })), { unit: "Ω", log: true });
  joined(plots, "phase", sweeps.map(({ name, one }) => ({ x: one.frequency_hz, values: one.phase_deg, label: name, ...look(told, name) })), { unit: "°", height: 180 });
  if (!changes.length) return;
  const bands = changes.flatMap(({ name, one }) => [
    { x: one.frequency_hz, values: one.db, label: name, ...look(told, name) },
    { x: one.frequency_hz, values: one.uncertainty_db, label: "", color: "--soft", dash: [2, 4], width: 1 },
    { x: one.frequency_hz, values: one.uncertainty_db.map((value) => -value), label: "", color: "--soft", dash: [2, 4], width: 1 },
  ]);
  joined(plots, `change of |Z| from ${told.names[0]}; dotted: the uncertainty of both`, bands, { unit: "dB", height: 180, digits: 3 });
}

function drawSpectra(where, told) {
  const all = Object.entries(told.spectra).flatMap(([name, own]) => own.map((one) => ({ name, one })));
  for (const detector of new Set(all.map(({ one }) => one.detector))) {
    const box = card(`${detector} detector`);
    where.append(box);
    joined(new Plots(box), "level", all.filter(({ one }) => one.detector === detector).map(({ name, one }) => ({ x: one.frequency_hz, values: one.level_dbuv, label: name, width: 1, ...look(told, name) })), { unit: "dBµV", height: 300 });
  }
}

// Sessions may stand on different frequencies.
function joined(plots, title, lines, settings) {
  const [x, ...values] = uPlot.join(lines.map((one) => [one.x, one.values]));
  plots.add(title, x, lines.map((one, index) => ({ ...one, values: values[index] })), settings);
}
