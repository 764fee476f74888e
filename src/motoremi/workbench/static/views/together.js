// The view Compare: overlays of several sessions and the tables of their common report; each compared with the first.

import { get, within } from "../api.js";
import { brief, button, card, h, table } from "../dom.js";
import { save } from "../exports.js";
import { Plots } from "../plot.js";
import { symbols } from "../units.js";

/* global uPlot */

// Key in sessionStorage: the chosen sessions survive a reload of this tab.
const CHOSEN = "motoremi-together";
// As many looks as can be distinguished, also without colour.
export const LOOKS = [
  { color: "--measured" }, { color: "--model", dash: [8, 4] }, { color: "--other", dash: [12, 3, 2, 3] }, { color: "--fourth", dash: [2, 3] },
  { color: "--third", dash: [18, 4] }, { color: "--bad", dash: [6, 3, 2, 3, 2, 3] }, { color: "--limit", dash: [2, 6] }, { color: "--soft", dash: [12, 3, 4, 3] },
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

  shows: (session) => chosen().includes(session),

  load: () => (chosen().length < 2 ? null : get(address())),

  draw(where, data, page) {
    if (!data) {
      where.append(h("p", { class: "empty" }, "Choose two or more sessions in the list of the view Files."));
      return;
    }
    where.append(card("Verdicts", h("p", { class: "note" }, `Compared with ${data.names[0]}.`), drawn(data.verdicts, "together-verdicts"),
      h("div", { class: "row" }, "As a report: ", FILES.map((name) => button(name, () => page.work(`writing ${name}`, () => save(address(`/${name}`), name)), { "data-export": name })))));
    const columns = h("div", { class: "columns pairs" });
    where.append(columns);
    for (const termination of ["short", "open"]) drawSweeps(columns, data, termination, page);
    drawSpectra(columns, data, page);
    if (data.parameters) where.append(card(data.parameters.title, data.parameters.texts.map((text) => h("p", { class: "note" }, text)), drawn(data.parameters, "together-parameters", unbroken)));
    if (data.bands) where.append(card(data.bands.title, drawn(data.bands, "together-bands")));
  },
};

// Breaks only before an error bar and before a bracket, so that a number keeps its unit.
const unbroken = (text) => text.replace(/ (?![±(])/g, "\u00a0");

function drawn({ columns, rows, marked }, id, written = (text) => text) {
  const mood = { PASS: "good", FAIL: "bad" };
  return table(columns, rows.map((row, index) => h("tr", marked.includes(index) ? { class: "marked" } : {},
    row.map((cell, column) => (column === 0 ? h("th", { scope: "row" }, cell) : h("td", { class: [mood[cell], brief(cell)].filter(Boolean).join(" ") }, written(symbols(cell))))))), { id });
}

// Each session has the same look in every plot.
const look = (data, name) => LOOKS[data.names.indexOf(name)];

const ofOne = (lists, chosen) => Object.entries(lists).flatMap(([name, all]) => all.filter(chosen).map((one) => ({ name, one })));

// Draw plots that load the omitted points of a curve when zoomed.
function draw(box, data, curves, frames, page) {
  const more = (span) => page.attempt(async () => frames(await get(within(address(), span))));
  new Plots(box).draw(frames(data), curves.some(({ one }) => one.points > one.frequency_hz.length) && more);
}

function drawSweeps(where, data, termination, page) {
  const sweeps = ofOne(data.sweeps, (one) => one.termination === termination);
  if (!sweeps.length) return;
  const box = card(`${termination}-circuit sweep`);
  where.append(box);
  draw(box, data, sweeps, (fresh) => sweepFrames(fresh, termination), page);
}

function sweepFrames(data, termination) {
  const [sweeps, changes] = [data.sweeps, data.changes].map((lists) => ofOne(lists, (one) => one.termination === termination));
  const frames = [];
  joined(frames, "magnitude |Z|", sweeps.map(({ name, one }) => ({ x: one.frequency_hz, values: one.magnitude_ohm, label: name, ...look(data, name) })), { unit: "Ω", log: true });
  joined(frames, "phase", sweeps.map(({ name, one }) => ({ x: one.frequency_hz, values: one.phase_deg, label: name, ...look(data, name) })), { unit: "°", height: 180 });
  if (!changes.length) return frames;
  const bands = changes.flatMap(({ name, one }) => [
    { x: one.frequency_hz, values: one.db, label: name, ...look(data, name) },
    { x: one.frequency_hz, values: one.uncertainty_db, label: "", color: "--soft", dash: [2, 4], width: 1 },
    { x: one.frequency_hz, values: one.uncertainty_db.map((value) => -value), label: "", color: "--soft", dash: [2, 4], width: 1 },
  ]);
  joined(frames, `change of |Z| from ${data.names[0]}; dotted: the uncertainty of both`, bands, { unit: "dB", height: 180, digits: 3 });
  return frames;
}

function drawSpectra(where, data, page) {
  const all = ofOne(data.spectra, () => true);
  for (const detector of new Set(all.map(({ one }) => one.detector))) {
    const box = card(`${detector} detector`);
    where.append(box);
    draw(box, data, all, (fresh) => spectrumFrames(fresh, detector), page);
  }
}

function spectrumFrames(data, detector) {
  const frames = [];
  joined(frames, "level", ofOne(data.spectra, (one) => one.detector === detector).map(({ name, one }) => ({ x: one.frequency_hz, values: one.level_dbuv, label: name, width: 1, ...look(data, name) })), { unit: "dBµV", height: 300 });
  return frames;
}

// Sessions may have different frequencies.
function joined(frames, title, lines, settings) {
  const [x, ...values] = uPlot.join(lines.map((one) => [one.x, one.values]));
  frames.push([title, x, lines.map((one, index) => ({ ...one, values: values[index] })), settings]);
}
