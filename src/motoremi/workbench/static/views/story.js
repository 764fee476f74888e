// The whole story on one screen: measured against model, the error beside the floor, the ladder and the effects. Pointing at an effect draws what it
// would do on the same curves, a click adds it. What comes next is the one primary button. Of the sweeps and of the spectra alike.

import { get, post, sessionPath, within } from "../api.js";
import { button, facts, h, table } from "../dom.js";
import { ladderDrawing } from "../ladder.js";
import { legend, Plots } from "../plot.js";
import { stay } from "../stay.js";
import { term } from "../terms.js";
import { chance, lag, percent, share, show, symbols } from "../units.js";

// A pointer that only passes over a row asks for nothing.
const REST_MS = 120;
// A panel narrower than this cannot be read: then one is shown at a time.
const NARROWEST = 250;
const SIDE = "motoremi-story";
const NAMES = { impedance: "Impedance", emission: "Emission" };
const PANELS = { short: "short-circuit sweep", open: "open-circuit sweep" };
const BASES = { impedance: "paper's circuit", emission: "source and motor alone" };
const FLOORS = { impedance: "noise and analyser", emission: "scatter and formulas" };
const LOOKS = {
  measured: { color: "--measured", points: true },
  model: { color: "--model", width: 2 },
  preview: { color: "--other", width: 2, dash: [7, 4] },
  floor: { color: "--soft", dash: [6, 4] },
  tolerance: { color: "--bad", dash: [2, 4] },
  fails: { color: "--bad", points: true },
};
const DOING = {
  fit: "fitting: from rough to all points", diagnose: "trying every effect of the catalogue", add: "adding", drop: "going back one step", redo: "putting it back",
  predict: "predicting the spectrum", report: "writing the report",
};

export const story = {
  title: "Story",

  // What is pointed at stays.
  changed: true,

  load: (page) => get(sessionPath(page.session, `/story?of=${sessionStorage.getItem(SIDE) ?? ""}`)),

  draw(where, told, page) {
    const place = { page, told, pointed: "", shown: null, looked: new Map(), resting: 0, turn: 0, chosen: 0, span: null };
    build(place, where);
    render(place);
    suggest(place);
    page.listeners.add((kind) => kind === "changed" && !place.acting && follow(place));
    page.viewKey = (event) => keyed(place, event);
  },
};

function build(place, where) {
  const part = (name, tag = "div", attributes = {}) => (place[name] = h(tag, { id: `story-${name}`, ...attributes }));
  part("stages", "ol", { "aria-label": "Steps of the story" });
  place.next = h("button", { type: "button", class: "main", id: "next-step", onclick: () => goOn(place) });
  place.outcome = h("p", { id: "outcome", role: "status", class: "large" });
  part("floor", "p", { class: "note" });
  part("doubt", "p", { class: "bad" });
  place.drop = button("Drop", () => act(place, "drop"), { id: "drop", title: "Take out the effect that was added last (D)" });
  place.redo = button("Redo", () => act(place, "redo"), { id: "redo" });
  part("sides", "div", { role: "group", "aria-label": "Story of" });
  part("curves", "section", { "aria-label": "Measured against model" });
  part("panels", "div", { role: "group", "aria-label": "Shown" });
  part("legend", "p");
  place.foot = h("div", { class: "foot" });
  place.curves.append(h("div", { class: "row" }, place.legend, place.panels));
  part("steps", "section", { "aria-label": "Ladder", tabindex: 0 });
  part("hint");
  part("list", "section", { "aria-label": "Effects" });
  place.where = h("div", { class: "story" },
    h("div", { class: "now" }, place.stages, place.next),
    h("div", { class: "result" }, place.outcome, place.floor, place.doubt, place.drop, place.redo, place.sides),
    place.curves, h("div", { class: "beside" }, place.steps, place.hint, place.list));
  where.append(place.where);
}

// Everything that follows from what the workbench told; the elements that one may have the focus on stay.
function render(place) {
  const { told } = place, write = (value) => written(told, value), restore = stay(place.where), top = told.ladder.at(-1);
  place.stages.replaceChildren(...told.stages.map((one, index) => stage(told, one, index)));
  place.next.textContent = told.next.text;
  place.sides.replaceChildren(...(told.sides.length > 1 ? told.sides.map((of) => button(NAMES[of], () => turn(place, of), { id: `of-${of}`, "aria-pressed": String(of === told.of) })) : []));
  if (!place.outcome.textContent) say(place, top ? `error ${write(top.error)}` : "no model yet");
  place.floor.replaceChildren(...(top ? [FLOORS[told.of] === FLOORS.impedance ? term("noise and analyser") : FLOORS[told.of], ` would leave ${write(top.floor)}`] : []));
  turnOff(place.drop, told.ladder.length < 2);
  turnOff(place.redo, !told.dropped.length);
  place.redo.title = told.dropped.length ? `Put back ${told.dropped[0].added} (R)` : "Nothing was dropped last (R)";
  const { ladder, dropped } = told;
  place.steps.replaceChildren(top ? ladderDrawing(ladder, dropped, { base: BASES[told.of], floorName: FLOORS[told.of], write, back: (count) => act(place, "drop", { count }), again: (count) => act(place, "redo", { count }) }) : h("p", { class: "note" }, "The ladder begins with the first fit."));
  place.doubt.textContent = top?.converged === false ? "The fit did not converge: do not use its values." : "";
  // The last step and the floor are what one looks for.
  place.steps.scrollTop = place.steps.scrollHeight;
  drawCurves(place);
  drawPointed(place);
  drawList(place);
  restore();
}

// What has the focus keeps it, also where there is nothing to do for the moment.
function turnOff(one, off) {
  one.setAttribute("aria-disabled", off);
}

const written = (told, value) => (told.unit === "%" ? percent(value) : show(value, told.unit, 3));

function stage(told, { title, done, view }, index) {
  const current = index === told.stages.findIndex((one) => !one.done);
  const text = [h("span", { class: "mark", "aria-hidden": true }, done ? "✓" : String(index + 1)), h("span", { class: "title" }, title), h("span", { class: "unseen" }, done ? ", done" : "")];
  return h("li", { "aria-current": current ? "step" : null, class: done ? "done" : "" }, view ? h("a", { href: `#${view}`, title }, text) : h("span", {}, text));
}

function drawCurves(place) {
  const { told } = place, shape = JSON.stringify(told.panels.map((panel) => [panel.name, panel.points, panel.frames.map((frame) => [frame.title, frame.series.length])]));
  if (place.shape !== shape) {
    place.shape = shape;
    place.plots?.destroy();
    place.plots = new Plots(place.curves);
    place.foot.replaceChildren(place.plots.readout, place.plots.tools);
    place.curves.append(place.foot);
    place.plots.host.dataset.rows = Math.max(0, ...told.panels.map((panel) => panel.frames.length));
    place.frames = told.panels.flatMap((panel, at) => panel.frames.map((frame, row) => ({
      at, row, frame: place.plots.add(`${row ? "" : `${PANELS[panel.name] ?? panel.name}: `}${frame.title}`, panel.frequency_hz, curvesOf(place, at, row),
        { unit: frame.unit, log: frame.log, height: null, digits: 3, panel: panel.name, hold: true, bare: { legend: true, frequency: row < panel.frames.length - 1 } }),
    })));
    arrange(place);
    new ResizeObserver(() => arrange(place)).observe(place.plots.host);
  } else {
    for (const { at, row, frame } of place.frames) place.plots.change(frame, curvesOf(place, at, row), told.panels[at].frequency_hz);
  }
  place.plots.ask = told.panels.some((panel) => panel.points > panel.frequency_hz.length) && ((span) => fillIn(place, span));
  drawLegend(place);
  place.foot.hidden = !told.panels.length;
  if (!told.panels.length) place.legend.textContent = "Nothing is measured yet that a model could explain.";
}

// The points that were left out, of the span that is shown; of the effect that is pointed at too.
async function fillIn(place, span) {
  const { page, told } = place;
  place.span = span;
  const fresh = await page.attempt(() => get(within(sessionPath(page.session, `/panels?of=${told.of}`), span)));
  if (!fresh || place.span !== span || place.told !== told || !place.list.isConnected) return;
  told.panels = fresh.panels;
  drawCurves(place);
  if (place.pointed) look(place, place.pointed);
}

function curvesOf({ told, shown }, at, row) {
  const { frequency_hz: x, frames } = told.panels[at], frame = frames[row], preview = shown?.panels[at][row];
  const curves = frame.series.map((one) => ({ ...LOOKS[one.role], label: one.role === "fails" ? "" : one.label, values: one.values, points: LOOKS[one.role].points && x.length <= 1000 }));
  if (told.ladder.length) curves.push({ ...LOOKS.preview, label: shown ? `with ${shown.effect}` : "", values: preview?.length === x.length ? preview : x.map(() => null) });
  return frame.log ? curves.map((one) => ({ ...one, values: one.values.map((value) => (value > 0 ? value : null)) })) : curves;
}

// One legend for all frames; it stays as it is whatever is pointed at, so that the curves do not jump.
function drawLegend({ legend: where, told }) {
  const roles = new Set(told.panels.flatMap((panel) => panel.frames.flatMap((frame) => frame.series.map((one) => one.role))));
  const names = { measured: "measured", model: "model", preview: "with the effect", floor: told.of === "impedance" ? "uncertainty" : FLOORS.emission, tolerance: "tolerance", fails: "fails" };
  if (told.ladder.length) roles.add("preview");
  where.replaceChildren(...Object.keys(names).filter((role) => roles.has(role)).map((role) => legend({ ...LOOKS[role], label: names[role] })));
}

// As many panels beside each other as can be read, else one at a time.
function arrange(place) {
  const { host } = place.plots, { panels } = place.told, all = panels.length <= Math.max(1, Math.floor(host.clientWidth / NARROWEST));
  const open = Math.min(place.chosen, panels.length - 1);
  for (const { at, frame } of place.frames) frame.holder.hidden = !all && at !== open;
  // One panel is read at a time.
  place.plots.panel = panels[all ? 0 : open]?.name;
  const key = `${all} ${open} ${panels.length}`;
  if (place.arranged !== key) {
    place.arranged = key;
    place.panels.replaceChildren(...(all ? [] : panels.map((panel, at) => button(panel.name, () => choose(place, at), { id: `panel-${at}`, "aria-pressed": String(at === open) }))));
  }
  place.plots.resize();
}

function choose(place, at) {
  place.chosen = at;
  arrange(place);
  document.getElementById(`panel-${at}`).focus();
}

function drawPointed(place) {
  const { told, shown, pointed } = place;
  const entry = told.catalogue.find((one) => one.id === pointed);
  if (!told.ladder.length) place.hint.replaceChildren();
  else if (!pointed) place.hint.replaceChildren(h("p", { class: "note" }, "Point at an effect to see ", term("signature", "what it would do"), "; a click adds it."));
  else if (place.trouble) place.hint.replaceChildren(h("p", { class: "bad", role: "status" }, place.trouble));
  else {
    place.hint.replaceChildren(
      h("p", { role: "status" }, h("strong", { id: "signature-of" }, shown?.effect ?? pointed), shown ? `: error ${written(told, shown.before.error)} → ${written(told, shown.after.error)}` : ": working out what it would do", h("span", { class: "note" }, ` ${entry?.title ?? ""}${entry?.accumulates ? "; this is one, and adding takes as many as lower the error" : ""}`)),
      button("Add", () => add(place, pointed), { id: "add", "aria-label": `Add ${pointed}` }));
  }
}

// The ranking first; below it what the diagnosis did not take to its end, for who wants to try it by hand.
function rows({ diagnosis, catalogue }) {
  const ranked = diagnosis?.candidates ?? [], known = new Set(ranked.map((one) => one.effect));
  return [...ranked, ...catalogue.filter((one) => !known.has(one.id)).map((one) => ({ effect: one.id, family: one.family }))];
}

function drawList(place) {
  const { told } = place, titles = Object.fromEntries(told.catalogue.map((one) => [one.id, one.title]));
  if (!told.ladder.length) {
    place.list.replaceChildren();
    return;
  }
  const row = (one) => {
    const inModel = told.in_model.includes(one.effect), error = one.error ?? place.looked.get(one.effect);
    const name = h("button", { type: "button", class: "effect", "data-effect": one.effect, "aria-label": `${addable(place, one.effect) ? (inModel ? "add another" : "add") : "in the model:"} ${one.effect}`, onclick: () => clicked(place, one.effect), onfocus: (event) => event.target.matches(":focus-visible") && point(place, one.effect) }, one.effect);
    const cells = [[name, inModel && h("span", { class: "good" }, " in the model"), h("div", { class: "note" }, titles[one.effect] ?? one.family)]];
    if (told.diagnosis) cells.push([one.probability === undefined ? "-" : chance(one.probability)], [one.delta_bic === undefined ? "-" : lag(one.delta_bic)]);
    cells.push([error === undefined ? "-" : written(told, error), one.plausible === false && h("div", { class: inModel ? "note" : "bad" }, term("plausible", "out of range"))]);
    return h("tr", { class: "choice", "aria-current": String(one.effect === place.pointed), onpointerenter: (event) => event.pointerType === "mouse" && point(place, one.effect), onclick: (event) => event.target.closest("button, dfn") || clicked(place, one.effect) }, cells.map((cell) => h("td", {}, cell)));
  };
  const head = [term("effect"), ...(told.diagnosis ? [term("probability"), term("delta BIC", "Δ BIC")] : []), term("candidate", "error with it")];
  place.list.replaceChildren(verdict(place), table(head, rows(told).map(row), { id: "ranking", class: told.diagnosis ? "ranked" : "" }), about(place));
}

function verdict(place) {
  const { told } = place, found = told.diagnosis;
  if (told.sealed) return h("p", { class: "note" }, "This motor is sealed: there is no ranking until you have given your answer (view Challenge). You can try effects by hand.");
  const again = h("div", { class: "row" }, told.next.do !== "diagnose" && button(found ? "Diagnose again" : "Find what is missing", () => act(place, "diagnose"), { id: "diagnose" }), button("Fit again", () => act(place, "fit"), { id: "fit" }));
  if (!found) return again;
  const added = found.effects.length > 0 && found.effects.every((one) => told.in_model.includes(one));
  return h("div", { id: "verdict" },
    h("p", { class: added ? "good" : found.mood }, added ? `Was missing, is in the model now: ${found.effects.join(", ")}; ` : `${found.sentence}; `, term("confidence"), ` ${share(found.confidence)}`),
    !told.current && h("p", { class: "note" }, `This ranking is of the model ${found.base.effects.length ? `with ${found.base.effects.join(" + ")}` : "without any effect"}; the ladder has moved since.`),
    found.findings.filter((one) => one.serious).map(finding),
    h("details", { id: "why", open: place.why, ontoggle: (event) => { place.why = event.target.open; } }, h("summary", {}, "Why, and what else was seen"),
      found.reasons.map((text) => h("p", {}, text)),
      found.described && h("p", {}, `The model ${found.described}.`),
      told.ladder.at(-1).beside.map((text) => h("p", {}, text)),
      found.observations.map((text) => h("p", {}, text)),
      found.findings.filter((one) => !one.serious).map(finding),
      found.families.length > 0 && h("p", {}, term("family", "not told apart"), `: ${found.families.map((one) => one.join(", ")).join("; ")}`),
      found.caveats.map((text) => h("p", { class: "note" }, text)),
      again));
}

const finding = (one) => h("p", { class: one.serious ? "bad" : "note" }, term("finding", one.id), ` (${one.place}): ${one.why}; ${one.remedy}`);

function about({ told, pointed }) {
  const entry = told.catalogue.find((one) => one.id === pointed), parameters = told.diagnosis?.candidates.find((one) => one.effect === pointed)?.parameters;
  return h("div", { id: "about" }, entry && [h("h2", {}, `About ${pointed}`), facts([["what it is", entry.title], ...(parameters ? [["values", symbols(parameters)]] : []), ["law", entry.formula], ["signature", entry.signature], ["look-alikes", entry.look_alikes.join(", ")], ["decided by", entry.deciding], ["source", entry.source]])]);
}

// A finger has nothing to point with: the first tap points, the second adds. A mouse points before it clicks, and so does the focus.
function clicked(place, effect) {
  if (place.pointed === effect) add(place, effect);
  else point(place, effect, 0);
}

function point(place, effect, rest = REST_MS) {
  place.pointed = effect;
  clearTimeout(place.resting);
  place.resting = setTimeout(() => look(place, effect), rest);
}

// What was found to be missing is pointed at.
function suggest(place) {
  const { next } = place.told;
  if (next.do === "add") look(place, next.effect);
}

async function look(place, effect) {
  place.pointed = effect;
  for (const row of place.list.querySelectorAll("tr.choice")) row.setAttribute("aria-current", row.querySelector("[data-effect]").dataset.effect === effect);
  document.getElementById("about")?.replaceWith(about(place));
  place.trouble = "";
  place.shown = null;
  if (!addable(place, effect)) place.pointed = "";
  drawPointed(place);
  if (!place.pointed) {
    drawCurves(place);
    return;
  }
  const { span } = place;
  let told;
  try {
    told = await get(within(sessionPath(place.page.session, `/look?of=${place.told.of}&effect=${encodeURIComponent(effect)}`), span));
  } catch (trouble) {
    place.trouble = `${effect}: ${trouble.message}`;
  }
  if (told?.superseded || place.pointed !== effect || !place.list.isConnected) return;
  if (span !== place.span) {
    look(place, effect);
    return;
  }
  if (told) place.looked.set(effect, told.after.error);
  place.shown = told ?? null;
  drawCurves(place);
  drawPointed(place);
}

// A motor may have several of some effects.
const addable = ({ told }, effect) => told.catalogue.find((one) => one.id === effect)?.possible ?? true;

function add(place, effect) {
  if (addable(place, effect)) act(place, "add", { effect });
}

function goOn(place) {
  const { next } = place.told;
  if (next.do === "go") {
    place.page.go(next.view);
    document.getElementById("main").focus();
  } else if (next.do === "turn") turn(place, "emission");
  else act(place, next.do, next.effect ? { effect: next.effect } : {});
}

async function turn(place, of) {
  sessionStorage.setItem(SIDE, of);
  await place.page.redraw(true);
}

// The new error first; the rest follows. One thing at a time: a second click waits for nothing and does nothing.
async function act(place, what, body = {}) {
  if (place.acting) return;
  clearTimeout(place.resting);
  if (place[what]?.ariaDisabled === "true") return;
  const { page, told } = place, added = place.hint.contains(document.activeElement) && body.effect, stepped = place.steps.contains(document.activeElement);
  place.acting = true;
  const done = await page.work(`${DOING[what]}${body.effect ? ` ${body.effect}` : ""}`, () => post(sessionPath(page.session, `/${what}`), { ...body, of: told.of, standing: told.standing }));
  if (done?.after) say(place, `error ${written(told, done.before.error)} → ${written(told, done.after.error)}`);
  if (done && done.after) place.pointed = "";
  await read(place);
  if (done && !done.after) say(place, ...outcomeOf(place, what, done));
  if (what === "diagnose") suggest(place);
  // The button that was pressed has gone with what it was for.
  if (added) place.list.querySelector(`[data-effect="${CSS.escape(added)}"]`)?.focus();
  if (stepped && !place.steps.contains(document.activeElement)) place.steps.focus();
  place.acting = false;
}

function outcomeOf({ told, page }, what, done) {
  const more = {
    fit: () => [],
    diagnose: () => [told.diagnosis.sentence],
    predict: () => ["judged: the verdict stands in the view Emission and in the report"],
    report: () => ["report written: ", ...done.files.filter((name) => /\.(pdf|html)$/.test(name)).flatMap((name) => [h("a", { href: sessionPath(page.session, `/report/${encodeURIComponent(name)}`), download: name }, name), " "])],
  };
  return [...(told.ladder.length ? [`error ${written(told, told.ladder.at(-1).error)}  `] : []), h("small", {}, ...more[what]())];
}

function say(place, ...what) {
  place.outcome.replaceChildren(...what);
}

// Somebody else changed the session.
async function follow(place) {
  const before = place.told;
  await read(place);
  const { ladder, standing } = place.told;
  if (standing === before.standing || !ladder.length) return;
  const was = before.ladder.length ? `, error ${written(before, before.ladder.at(-1).error)} → ${written(before, ladder.at(-1).error)}` : "";
  say(place, h("small", {}, `The ladder was changed elsewhere: ${before.ladder.length} → ${ladder.length} steps${was}`));
}

async function read(place) {
  const { page } = place, turn = ++place.turn;
  let fresh;
  try {
    [fresh] = await Promise.all([get(within(sessionPath(page.session, `/story?of=${place.told.of}`), place.span)), page.refresh()]);
  } catch (trouble) {
    page.complain(trouble.message);
    return;
  }
  if (turn !== place.turn || !place.list.isConnected) return;
  const moved = fresh.standing !== place.told.standing;
  place.told = fresh;
  if (moved) {
    place.shown = null;
    place.looked.clear();
  }
  render(place);
  if (moved && place.pointed) look(place, place.pointed);
}

function keyed(place, event) {
  const key = event.key.toLowerCase();
  if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    const all = [...place.list.querySelectorAll("button.effect")], at = all.indexOf(document.activeElement);
    all[Math.min(all.length - 1, Math.max(0, at + (event.key === "ArrowDown" ? 1 : -1)))]?.focus();
    event.preventDefault();
  } else if (key === "d") act(place, "drop");
  else if (key === "r") act(place, "redo");
  else if (key === "n") {
    place.next.focus();
    goOn(place);
  }
}
