// The view Story, for sweeps and for spectra: measurement and model, error and floor, the ladder, and the effects on one screen. Pointing at an effect
// previews it on the same curves, a click adds it, and the one primary button does the next step.

import { get, post, sessionPath, within } from "../api.js";
import { button, facts, h, table } from "../dom.js";
import { ladderDrawing } from "../ladder.js";
import { legend, Plots } from "../plot.js";
import { stay } from "../stay.js";
import { term } from "../terms.js";
import { chance, lag, percent, share, show, symbols } from "../units.js";
import { resumeRun } from "./session.js";

// The pointer must rest on a row for this time before its preview is requested.
const REST_MS = 120;
// Panels narrower than this are unreadable: then only one is shown at a time.
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
  tolerance: { color: "--limit", dash: [2, 4] },
  fails: { color: "--bad", points: true },
};
const DOING = {
  fit: "fitting", diagnose: "trying every effect of the catalogue", add: "adding", drop: "going back one step", redo: "putting it back",
  predict: "predicting the spectrum", report: "writing the report",
};

export const story = {
  title: "Story",

  // This view handles changes itself, so that the effect pointed at is kept.
  changed: true,

  load: (page) => get(sessionPath(page.session, `/story?of=${sessionStorage.getItem(SIDE) ?? ""}`)),

  draw(where, data, page) {
    const place = { page, data, pointed: "", shown: null, looked: new Map(), resting: 0, turn: 0, chosen: 0, span: null };
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

// Draw everything that depends on the workbench's data; elements that can hold the focus are kept.
function render(place) {
  const { data } = place, write = (value) => written(data, value), restore = stay(place.where), top = data.ladder.at(-1);
  place.stages.replaceChildren(...data.stages.map((one, index) => stage(data, one, index)));
  place.next.textContent = data.next.text;
  place.sides.replaceChildren(...(data.sides.length > 1 ? data.sides.map((of) => button(NAMES[of], () => turn(place, of), { id: `of-${of}`, "aria-pressed": String(of === data.of) })) : []));
  if (!place.outcome.textContent) say(place, top ? `error ${write(top.error)}` : data.modelled ? "no model yet" : data.panels.length ? "measured levels" : "nothing measured yet");
  place.floor.replaceChildren(...(top ? [FLOORS[data.of] === FLOORS.impedance ? term("noise and analyser") : FLOORS[data.of], ` would leave ${write(top.floor)}`] : []));
  turnOff(place.drop, data.ladder.length < 2);
  turnOff(place.redo, !data.dropped.length);
  place.redo.title = data.dropped.length ? `Put back ${data.dropped[0].added} (R)` : "Nothing was dropped last (R)";
  const { ladder, dropped } = data;
  place.steps.replaceChildren(top ? ladderDrawing(ladder, dropped, { base: BASES[data.of], floorName: FLOORS[data.of], write, back: (count) => act(place, "drop", { count }), again: (count) => act(place, "redo", { count }) }) : beforeTheFirstFit(place));
  place.doubt.textContent = top?.converged === false ? "The fit did not converge: do not use its values." : "";
  // Show the last step and the floor, which matter most.
  place.steps.scrollTop = place.steps.scrollHeight;
  drawCurves(place);
  drawPointed(place);
  drawList(place);
  restore();
}

function beforeTheFirstFit(place) {
  const { data } = place, interrupted = data.next.do === "resume";
  if (data.panels.length && !data.modelled) return h("p", { class: "note" }, "A model of spectra needs the motor's open-circuit sweep. Without it, the measured levels are judged against a limit.");
  return h("div", { class: "row" },
    h("p", { class: "note" }, interrupted ? "The run was interrupted: resume it, or work with what was measured." : "The ladder begins with the first fit."),
    interrupted && data.panels.length > 0 && button(data.fit, () => act(place, "fit"), { id: "fit" }));
}

// Not `disabled`: a button that has the focus must keep it while there is nothing for it to do.
function turnOff(one, off) {
  one.setAttribute("aria-disabled", off);
}

const written = (data, value) => (data.unit === "%" ? percent(value) : show(value, data.unit, 3));

function stage(data, { title, done, view }, index) {
  const current = index === data.stages.findIndex((one) => !one.done);
  const text = [h("span", { class: "mark", "aria-hidden": true }, done ? "✓" : String(index + 1)), h("span", { class: "title" }, title), h("span", { class: "unseen" }, done ? ", done" : "")];
  return h("li", { "aria-current": current ? "step" : null, class: done ? "done" : "" }, view ? h("a", { href: `#${view}`, title }, text) : h("span", {}, text));
}

function drawCurves(place) {
  const { data } = place, shape = JSON.stringify(data.panels.map((panel) => [panel.name, panel.points, panel.frames.map((frame) => [frame.title, frame.series.length])]));
  if (place.shape !== shape) {
    place.shape = shape;
    place.plots?.destroy();
    place.plots = new Plots(place.curves);
    place.foot.replaceChildren(place.plots.readout, place.plots.tools);
    place.curves.append(place.foot);
    place.plots.host.dataset.rows = Math.max(0, ...data.panels.map((panel) => panel.frames.length));
    place.frames = data.panels.flatMap((panel, at) => panel.frames.map((frame, row) => ({
      at, row, frame: place.plots.add(`${row ? "" : `${PANELS[panel.name] ?? panel.name}: `}${frame.title}`, panel.frequency_hz, curvesOf(place, at, row),
        { unit: frame.unit, log: frame.log, height: null, digits: 3, panel: panel.name, hold: true, bare: { legend: true, frequency: row < panel.frames.length - 1 } }),
    })));
    arrange(place);
    new ResizeObserver(() => arrange(place)).observe(place.plots.host);
  } else {
    for (const { at, row, frame } of place.frames) place.plots.change(frame, curvesOf(place, at, row), data.panels[at].frequency_hz);
  }
  place.plots.ask = data.panels.some((panel) => panel.points > panel.frequency_hz.length) && ((span) => fillIn(place, span));
  drawLegend(place);
  place.foot.hidden = !data.panels.length;
  if (!data.panels.length) place.legend.textContent = "Nothing has been measured yet.";
}

// Load the omitted points of the shown span, also for the effect pointed at.
async function fillIn(place, span) {
  const { page, data } = place;
  place.span = span;
  const fresh = await page.attempt(() => get(within(sessionPath(page.session, `/panels?of=${data.of}`), span)));
  if (!fresh || place.span !== span || place.data !== data || !place.list.isConnected) return;
  data.panels = fresh.panels;
  drawCurves(place);
  if (place.pointed) look(place, place.pointed);
}

function curvesOf({ data, shown }, at, row) {
  const { frequency_hz: x, frames } = data.panels[at], frame = frames[row], preview = shown?.panels[at][row];
  const curves = frame.series.map((one) => ({ ...LOOKS[one.role], label: one.role === "fails" ? "" : one.label, values: one.values, points: LOOKS[one.role].points && x.length <= 1000 }));
  if (data.ladder.length) curves.push({ ...LOOKS.preview, label: shown ? `with ${shown.effect}` : "", values: preview?.length === x.length ? preview : x.map(() => null) });
  return frame.log ? curves.map((one) => ({ ...one, values: one.values.map((value) => (value > 0 ? value : null)) })) : curves;
}

// One legend for all frames, with the preview always in it, so that the curves do not move when an effect is pointed at.
function drawLegend({ legend: where, data }) {
  const roles = new Set(data.panels.flatMap((panel) => panel.frames.flatMap((frame) => frame.series.map((one) => one.role))));
  const names = { measured: "measured", model: "model", preview: "with the effect", floor: data.of === "impedance" ? "uncertainty" : FLOORS.emission, tolerance: "tolerance", fails: "fails" };
  if (data.ladder.length) roles.add("preview");
  where.replaceChildren(...Object.keys(names).filter((role) => roles.has(role)).map((role) => legend({ ...LOOKS[role], label: names[role] })));
}

// All panels side by side if they are readable, else one at a time.
function arrange(place) {
  const { host } = place.plots, { panels } = place.data, all = panels.length <= Math.max(1, Math.floor(host.clientWidth / NARROWEST));
  const open = Math.min(place.chosen, panels.length - 1);
  for (const { at, frame } of place.frames) frame.holder.hidden = !all && at !== open;
  // The readout is of the shown panel only.
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
  const { data, shown, pointed } = place;
  const entry = data.catalogue.find((one) => one.id === pointed);
  if (!data.ladder.length) place.hint.replaceChildren();
  else if (!pointed) place.hint.replaceChildren(h("p", { class: "note" }, "Point at an effect to see ", term("signature", "what it would do"), "; a click adds it."));
  else if (place.trouble) place.hint.replaceChildren(h("p", { class: "bad", role: "status" }, place.trouble));
  else {
    place.hint.replaceChildren(
      h("p", { role: "status" }, h("strong", { id: "signature-of" }, shown?.effect ?? pointed), shown ? `: error ${written(data, shown.before.error)} → ${written(data, shown.after.error)}` : ": computing its effect on the curves", h("span", { class: "note" }, ` ${entry?.title ?? ""}${entry?.accumulates ? "; this is one, and adding takes as many as lower the error" : ""}`)),
      button("Add", () => add(place, pointed), { id: "add", "aria-label": `Add ${pointed}` }));
  }
}

// The ranking first, then the effects that the diagnosis did not rank, to be tried by hand.
function rows({ diagnosis, catalogue }) {
  const ranked = diagnosis?.candidates ?? [], known = new Set(ranked.map((one) => one.effect));
  return [...ranked, ...catalogue.filter((one) => !known.has(one.id)).map((one) => ({ effect: one.id, family: one.family }))];
}

function drawList(place) {
  const { data } = place, titles = Object.fromEntries(data.catalogue.map((one) => [one.id, one.title]));
  if (!data.ladder.length) {
    place.list.replaceChildren();
    return;
  }
  const row = (one) => {
    const inModel = data.in_model.includes(one.effect), error = one.error ?? place.looked.get(one.effect);
    const name = h("button", { type: "button", class: "effect", "data-effect": one.effect, "aria-label": `${addable(place, one.effect) ? (inModel ? "add another" : "add") : "in the model:"} ${one.effect}`, onclick: () => clicked(place, one.effect), onfocus: (event) => event.target.matches(":focus-visible") && point(place, one.effect) }, one.effect);
    const cells = [[name, inModel && h("span", { class: "good" }, " in the model"), h("div", { class: "note" }, titles[one.effect] ?? one.family)]];
    if (data.diagnosis) cells.push([one.probability === undefined ? "-" : chance(one.probability)], [one.delta_bic === undefined ? "-" : lag(one.delta_bic)]);
    cells.push([error === undefined ? "-" : written(data, error), one.plausible === false && h("div", { class: inModel ? "note" : "bad" }, term("plausible", "out of range"))]);
    return h("tr", { class: "choice", "aria-current": String(one.effect === place.pointed), onpointerenter: (event) => event.pointerType === "mouse" && point(place, one.effect), onclick: (event) => event.target.closest("button, dfn") || clicked(place, one.effect) }, cells.map((cell) => h("td", {}, cell)));
  };
  const head = [term("effect"), ...(data.diagnosis ? [term("probability"), term("delta BIC", "Δ BIC")] : []), term("candidate", "error with it")];
  place.list.replaceChildren(verdict(place), table(head, rows(data).map(row), { id: "ranking", class: data.diagnosis ? "ranked" : "" }), about(place));
}

function verdict(place) {
  const { data } = place, found = data.diagnosis;
  if (data.sealed) return h("p", { class: "note" }, "This motor is sealed: there is no ranking before you have given your answer (view Challenge). You can try effects by hand.");
  const again = h("div", { class: "row" }, data.next.do !== "diagnose" && button(found ? "Diagnose again" : "Find what is missing", () => act(place, "diagnose"), { id: "diagnose" }), button("Fit again", () => act(place, "fit"), { id: "fit" }));
  if (!found) return again;
  const added = found.effects.length > 0 && found.effects.every((one) => data.in_model.includes(one));
  return h("div", { id: "verdict" },
    h("p", { class: added ? "good" : found.mood }, added ? `The missing effect is in the model now: ${found.effects.join(", ")}; ` : `${found.sentence}; `, term("confidence"), ` ${share(found.confidence)}`),
    !data.current && h("p", { class: "note" }, `This ranking is of the model ${found.base.effects.length ? `with ${found.base.effects.join(" + ")}` : "without any effect"}; the ladder has changed since.`),
    found.findings.filter((one) => one.serious).map(finding),
    h("details", { id: "why", open: place.why, ontoggle: (event) => { place.why = event.target.open; } }, h("summary", {}, "Why, and what else was seen"),
      found.reasons.map((text) => h("p", {}, text)),
      found.described && h("p", {}, `The model ${found.described}.`),
      data.ladder.at(-1).beside.map((text) => h("p", {}, text)),
      found.observations.map((text) => h("p", {}, text)),
      found.findings.filter((one) => !one.serious).map(finding),
      found.families.length > 0 && h("p", {}, term("family", "not distinguished"), `: ${found.families.map((one) => one.join(", ")).join("; ")}`),
      found.caveats.map((text) => h("p", { class: "note" }, text)),
      again));
}

const finding = (one) => h("p", { class: one.serious ? "bad" : "note" }, term("finding", one.id), ` (${one.place}): ${one.why}; ${one.remedy}`);

function about({ data, pointed }) {
  const entry = data.catalogue.find((one) => one.id === pointed), parameters = data.diagnosis?.candidates.find((one) => one.effect === pointed)?.parameters;
  return h("div", { id: "about" }, entry && [h("h2", {}, `About ${pointed}`), facts([["what it is", entry.title], ...(parameters ? [["values", symbols(parameters)]] : []), ["law", entry.formula], ["signature", entry.signature], ["look-alikes", entry.look_alikes.join(", ")], ["decided by", entry.deciding], ["source", entry.source]])]);
}

// On a touch screen the first tap points at an effect and the second adds it. Mouse and keyboard focus point before they click.
function clicked(place, effect) {
  if (place.pointed === effect) add(place, effect);
  else point(place, effect, 0);
}

function point(place, effect, rest = REST_MS) {
  place.pointed = effect;
  clearTimeout(place.resting);
  place.resting = setTimeout(() => look(place, effect), rest);
}

// Preview the effect that the diagnosis named.
function suggest(place) {
  const { next } = place.data;
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
  let data;
  try {
    data = await get(within(sessionPath(place.page.session, `/look?of=${place.data.of}&effect=${encodeURIComponent(effect)}&standing=${place.data.standing}`), span));
  } catch (trouble) {
    place.trouble = `${effect}: ${trouble.message}`;
  }
  if (data?.superseded || place.pointed !== effect || !place.list.isConnected) return;
  if (span !== place.span) {
    look(place, effect);
    return;
  }
  if (data) place.looked.set(effect, data.after.error);
  place.shown = data ?? null;
  drawCurves(place);
  drawPointed(place);
}

// Some effects can be added several times.
const addable = ({ data }, effect) => data.catalogue.find((one) => one.id === effect)?.possible ?? true;

function add(place, effect) {
  if (addable(place, effect)) act(place, "add", { effect });
}

function goOn(place) {
  const { next } = place.data;
  if (next.do === "go") {
    place.page.go(next.view);
    document.getElementById("main").focus();
  } else if (next.do === "turn") turn(place, "emission");
  else if (next.do === "resume") resumeRun(place.page);
  else act(place, next.do, next.effect ? { effect: next.effect } : {});
}

async function turn(place, of) {
  sessionStorage.setItem(SIDE, of);
  await place.page.redraw(true);
}

// Do one change and show the new error at once, then the rest. A second click is ignored during a change and until its result is shown.
async function act(place, what, body = {}) {
  if (place.acting) return;
  clearTimeout(place.resting);
  if (place[what]?.ariaDisabled === "true") return;
  const { page, data } = place, added = place.hint.contains(document.activeElement) && body.effect, stepped = place.steps.contains(document.activeElement);
  place.acting = true;
  const done = await page.work(`${DOING[what]}${body.effect ? ` ${body.effect}` : ""}`, () => post(sessionPath(page.session, `/${what}`), { ...body, of: data.of, standing: data.standing }));
  if (!done) {
    // Cancelled or refused: what is shown stands.
    place.acting = false;
    await read(place);
    return;
  }
  if (done.after) {
    say(place, `error ${written(data, done.before.error)} → ${written(data, done.after.error)}`);
    place.pointed = "";
  }
  await read(place);
  if (!done.after) say(place, ...outcomeOf(place, what, done));
  if (what === "diagnose") suggest(place);
  // The button that had the focus may no longer exist.
  if (added) place.list.querySelector(`[data-effect="${CSS.escape(added)}"]`)?.focus();
  if (stepped && !place.steps.contains(document.activeElement)) place.steps.focus();
  place.acting = false;
}

function outcomeOf({ data, page }, what, done) {
  const more = {
    fit: () => [],
    diagnose: () => [data.diagnosis.sentence],
    predict: () => ["judged: the verdict is in the view Emission and in the report"],
    report: () => ["report written: ", ...done.files.filter((name) => /\.(pdf|html)$/.test(name)).flatMap((name) => [h("a", { href: sessionPath(page.session, `/report/${encodeURIComponent(name)}`), download: name }, name), " "])],
  };
  return [...(data.ladder.length ? [`error ${written(data, data.ladder.at(-1).error)}  `] : []), h("small", {}, ...more[what]())];
}

function say(place, ...what) {
  place.outcome.replaceChildren(...what);
}

// The session was changed: elsewhere, or by work that this page began before it was loaded again.
async function follow(place) {
  const before = place.data;
  await read(place);
  const { ladder, standing } = place.data;
  if (standing === before.standing || !ladder.length) return;
  const now = written(before, ladder.at(-1).error);
  if (before.ladder.length) say(place, h("small", {}, `The ladder has changed: ${before.ladder.length} → ${ladder.length} steps, error ${written(before, before.ladder.at(-1).error)} → ${now}`));
  else say(place, `error ${now}`);
}

async function read(place) {
  const { page } = place, turn = ++place.turn;
  let fresh;
  try {
    [fresh] = await Promise.all([get(within(sessionPath(page.session, `/story?of=${place.data.of}`), place.span)), page.refresh()]);
  } catch (trouble) {
    page.complain(trouble.message);
    return;
  }
  if (turn !== place.turn || !place.list.isConnected) return;
  const moved = fresh.standing !== place.data.standing;
  place.data = fresh;
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
