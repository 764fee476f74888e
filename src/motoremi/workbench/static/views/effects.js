// Which effect is missing: the ranking with its evidence. Pointing at an effect shows its signature on this motor, a click adds it.

import { get, post, sessionPath } from "../api.js";
import { button, card, facts, h, table } from "../dom.js";
import { ladderDrawing } from "../ladder.js";
import { Plots } from "../plot.js";
import { stay } from "../stay.js";
import { term } from "../terms.js";
import { chance, lag, percent, share, symbols } from "../units.js";

// A pointer that only passes over a row asks for nothing.
const REST_MS = 120;
let resting = 0, shownFor = "";

export const effects = {
  title: "Effects",
  needs: "model",
  without: "Effects are added to a fitted model: fit this session first (view Session).",

  // The signature that is being looked at stays.
  changed: true,

  load: (page) => get(sessionPath(page.session, "/effects")),

  draw(where, told, page) {
    const place = { told, page };
    place.outcome = h("p", { id: "outcome", role: "status", class: "large" }, "");
    place.ladder = h("div", {});
    place.signature = card("Signature");
    place.list = h("div", {});
    const sealed = told.sealed && h("p", { class: "note" }, "This motor is sealed: there is no ranking until you have given your answer (view Challenge). You can try effects by hand.");
    where.append(h("div", { class: "columns" },
      h("div", {},
        card("Which effect is missing",
          sealed || h("div", { class: "row" }, button(told.diagnosis ? "Diagnose again" : "Diagnose", () => diagnose(place), { class: told.diagnosis ? "" : "main", id: "diagnose" }), h("span", { class: "note" }, "refits the model with every effect of the catalogue")),
          told.diagnosis && verdict(told), place.list)),
      h("div", {}, card("Ladder", place.outcome, place.ladder, h("div", { class: "row" }, button("Drop the last effect", () => drop(place), { id: "drop" }))), place.signature)));
    drawList(place);
    drawLadder(place, told.ladder);
    const first = rows(told).map((one) => one.effect).find((name) => !told.in_model.includes(name));
    if (first && told.diagnosis) look(place, first);
    page.listeners.add((kind) => kind === "changed" && !place.acting && follow(place));
    page.viewKey = (event) => {
      if (event.key === "ArrowDown" || event.key === "ArrowUp") {
        const all = [...place.list.querySelectorAll("button.effect")], at = all.indexOf(document.activeElement);
        all[Math.min(all.length - 1, Math.max(0, at + (event.key === "ArrowDown" ? 1 : -1)))]?.focus();
        event.preventDefault();
      } else if (event.key.toLowerCase() === "d") drop(place);
    };
  },
};

// The ranking first; below it what the diagnosis did not take to its end, for who wants to try it by hand.
function rows(told) {
  const ranked = told.diagnosis?.candidates ?? [], known = new Set(ranked.map((one) => one.effect));
  return [...ranked, ...told.catalogue.filter((one) => !known.has(one.id)).map((one) => ({ effect: one.id, family: one.family }))];
}

function verdict(told) {
  const found = told.diagnosis;
  return h("div", { id: "verdict" },
    h("p", { class: found.mood }, h("strong", {}, found.verdict), `: ${found.sentence}; `, term("confidence"), ` ${share(found.confidence)}`),
    found.reasons.map((text) => h("p", {}, text)),
    found.described && h("p", {}, `The model ${found.described}.`),
    found.findings.map((one) => h("p", { class: one.serious ? "bad" : "note" }, term("finding", one.id), ` (${one.place}): ${one.why}; ${one.remedy}`)),
    found.families.length > 0 && h("p", {}, term("family", "not told apart"), `: ${found.families.map((one) => one.join(", ")).join("; ")}`),
    found.caveats.map((text) => h("p", { class: "note" }, text)),
    !told.current && h("p", { class: "note" }, `This ranking is of the model with ${found.base.effects.join(" + ") || "no effect"}; the ladder has moved since. Diagnose again to rank what is left.`));
}

function drawList(place) {
  const { told } = place;
  const titles = Object.fromEntries(told.catalogue.map((one) => [one.id, one]));
  const row = (one) => {
    const inModel = told.in_model.includes(one.effect);
    const name = h("button", { type: "button", class: "effect", "data-effect": one.effect, "aria-label": `${inModel ? "in the model:" : "add"} ${one.effect}`, onclick: () => add(place, one.effect), onfocus: () => rest(place, one.effect) }, one.effect);
    const cells = [h("div", {}, name, inModel && h("span", { class: "good" }, " in the model"), h("div", { class: "note" }, titles[one.effect]?.title ?? one.family),
      one.parameters && h("div", {}, symbols(one.parameters), !one.plausible && h("span", { class: "bad" }, " beyond its physical range")))];
    if (told.diagnosis) cells.push(one.probability === undefined ? "-" : chance(one.probability), one.delta_bic === undefined ? "-" : lag(one.delta_bic), percent(one.rms_error_percent));
    else cells.push(one.family);
    return h("tr", { onmouseenter: () => rest(place, one.effect) }, cells.map((cell) => h("td", {}, cell)));
  };
  const head = told.diagnosis ? [term("effect"), term("probability"), term("delta BIC", "Δ BIC"), term("rms error")] : [term("effect"), "family"];
  place.list.replaceChildren(table(head, rows(told).map(row), { id: "ranking" }));
}

function drawLadder(place, steps) {
  place.ladder.replaceChildren(ladderDrawing(steps));
  document.getElementById("drop").disabled = steps.length < 2;
}

function rest(place, effect) {
  clearTimeout(resting);
  resting = setTimeout(() => look(place, effect), REST_MS);
}

async function look(place, effect) {
  if (place.told.in_model.includes(effect)) return;
  shownFor = effect;
  let told;
  try {
    told = await get(sessionPath(place.page.session, `/signature?effect=${encodeURIComponent(effect)}`));
  } catch (trouble) {
    if (shownFor === effect && place.signature.isConnected) place.signature.replaceChildren(h("h2", {}, `Signature: ${effect}`), h("p", {}, trouble.message));
    return;
  }
  if (told.superseded || shownFor !== effect || !place.signature.isConnected) return;
  place.plots?.forEach((one) => one.destroy());
  place.plots = [];
  place.signature.replaceChildren(
    h("h2", {}, "Signature: ", h("span", { id: "signature-of" }, effect)),
    h("p", {}, `Error without it ${percent(told.before.rms_error_percent)}, with it ${percent(told.after.rms_error_percent)}. `, term("signature", "How to read this")));
  for (const sweep of told.sweeps) {
    const box = h("div", {}, h("h3", {}, `${sweep.termination}-circuit sweep`));
    place.signature.append(box);
    const plots = new Plots(box);
    place.plots.push(plots);
    const pair = (unit) => [{ label: "wanted", values: sweep[`wanted_${unit}`], color: "--measured", points: sweep.frequency_hz.length <= 1000 }, { label: "given", values: sweep[`given_${unit}`], color: "--model" }];
    plots.add("magnitude over the model's", sweep.frequency_hz, pair("db"), { unit: "dB", height: 150 });
    plots.add("phase against the model's", sweep.frequency_hz, pair("deg"), { unit: "°", height: 130 });
  }
  const entry = told.entry;
  place.signature.append(facts([["what it is", entry.title], ["law", entry.formula], ["signature", entry.signature], ["look-alikes", entry.look_alikes.join(", ")], ["decided by", entry.deciding], ["source", entry.source]]));
}

const add = (place, effect) => act(place, `adding ${effect}`, "/add", { effect });
const drop = (place) => act(place, "going back one step", "/drop", {});

// The new error first; the rest of the view follows.
async function act(place, doing, path, body) {
  clearTimeout(resting);
  const { page } = place;
  place.acting = true;
  const told = await page.work(doing, () => post(sessionPath(page.session, path), { ...body, standing: place.told.standing }));
  if (told) place.outcome.textContent = `error ${percent(told.before.rms_error_percent)} → ${percent(told.after.rms_error_percent)}`;
  await read(place);
  place.acting = false;
}

// Somebody else changed the session.
async function follow(place) {
  const before = place.told;
  await read(place);
  const { ladder, standing } = place.told;
  if (standing !== before.standing) place.outcome.textContent = `The ladder was changed elsewhere: ${before.ladder.length} → ${ladder.length} steps, error ${percent(before.ladder.at(-1).rms_error_percent)} → ${percent(ladder.at(-1).rms_error_percent)}`;
}

async function read(place) {
  const { page } = place;
  let fresh;
  try {
    fresh = await get(sessionPath(page.session, "/effects"));
    await page.refresh();
  } catch (trouble) {
    page.complain(trouble.message);
    return;
  }
  if (!place.list.isConnected) return;
  if (Boolean(fresh.diagnosis) !== Boolean(place.told.diagnosis)) {
    await page.redraw(true);
    return;
  }
  const moved = fresh.standing !== place.told.standing, restore = stay(place.list);
  place.told = fresh;
  document.getElementById("verdict")?.replaceWith(verdict(fresh));
  drawList(place);
  drawLadder(place, fresh.ladder);
  restore();
  if (moved && shownFor) look(place, shownFor);
}

async function diagnose(place) {
  const { page } = place;
  const done = await page.work("diagnosing: every effect of the catalogue is refitted", () => post(sessionPath(page.session, "/diagnose"), { standing: place.told.standing }));
  if (done) await page.redraw(true);
}
