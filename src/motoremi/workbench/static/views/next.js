// The view Next: the measurement that distinguishes the explanations best, its result as files, as a value or from the bench, and the steps so far.

import { get, post, sessionPath } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { refused, take } from "../drop.js";
import { term } from "../terms.js";
import { chance, show } from "../units.js";
import { filesRead } from "./files.js";

// By session: what cannot be measured here, and which measurement was chosen instead of the first.
const impossible = new Map(), picked = new Map();
// Bits below which a measurement is not listed at first.
const LITTLE = 0.01;
const SWEEPS = new Set(["short", "open"]);
const BENCHES = { simulated: "the simulated bench", real: "the bench" };
const TERMINATIONS = { short: "the short-circuit sweep", open: "the open-circuit sweep", both: "both sweeps" };

export const next = {
  title: "Next",
  needs: "diagnosis",
  without: "What to measure next follows from a diagnosis: diagnose this session first (view Story).",

  async load(page) {
    const query = [...(impossible.get(page.session) ?? [])].map((id) => `without=${encodeURIComponent(id)}`).join("&");
    const [asked, files] = await Promise.all([get(sessionPath(page.session, `/next${query && "?"}${query}`)), get("/api/files")]);
    return { ...asked, files };
  },

  draw(where, data, page) {
    const one = data.alternatives.find((other) => other.id === picked.get(page.session)) ?? data.asked;
    if (data.newer) where.append(h("p", { class: "bad", id: "newer" }, "Data were added after the diagnosis: the request below is out of date."), h("div", { class: "row" }, button("Diagnose", () => page.work("diagnosing", async () => { await post(sessionPath(page.session, "/diagnose")); await page.redraw(true); }), { class: "main", id: "diagnose" })));
    where.append(h("div", { class: "columns" },
      h("div", {}, measure(data, one, page), one && answer(data, one, page)),
      h("div", {}, explanations(data), data.steps.length > 0 && way(data))),
    alternatives(data, one, page));
    page.listeners.add((kind) => kind === "files" && page.redraw(true));
  },
};

function measure(data, one, page) {
  if (!one) {
    return card("Nothing more is needed; to confirm it",
      h("p", { class: "large", id: "next-id" }, data.end || data.advice.id), data.why && h("p", { class: "sentence" }, data.why),
      data.advice.action && h("p", { id: "what-to-do" }, h("strong", {}, "What to do: "), `${data.advice.action}.`), h("p", { class: "sentence" }, data.advice.why),
      everything(data, page));
  }
  const first = one === data.asked;
  return card("Measure next",
    h("p", { class: "large", id: "next-id" }, one.id),
    h("p", { id: "what-to-do" }, h("strong", {}, "What to do: "), `${one.instruction}.`),
    h("p", { class: "sentence" }, first ? data.why : expected(one)),
    h("p", {}, term("next measurement", "How it was found")),
    h("div", { class: "row" },
      button("Not possible here", () => leaveOut(one.id, page), { id: "not-possible" }),
      !first && data.asked && button(`Back to ${data.asked.id}`, () => pick(null, page))),
    everything(data, page));
}

// The measurements that are left out, and a button that includes them again.
function everything(data, page) {
  if (!data.without.length) return "";
  return h("div", {},
    h("p", { class: "note" }, `Not possible here: ${data.without.join(", ")}.`),
    button("Include all measurements again", () => { impossible.delete(page.session); return pick(null, page); }, { id: "all-possible" }));
}

const expected = (one) => `Expected information: ${bits(one.information_bits)} bits in ${show(one.minutes, "", 3)} minutes.`;

function leaveOut(id, page) {
  impossible.set(page.session, new Set([...(impossible.get(page.session) ?? []), id]));
  return pick(null, page);
}

function pick(id, page) {
  if (id) picked.set(page.session, id);
  else picked.delete(page.session);
  return page.redraw(true);
}

// The three ways to give the result of a measurement.
function answer(data, one, page) {
  const first = one === data.asked && data.benches.length > 0;
  return h("div", {},
    first && onBench(data, page),
    one.kind === "value" ? asValue(one, page) : asFiles(data, one, page));
}

function onBench(data, page) {
  const budget = h("input", { type: "text", id: "budget", value: "2h", size: 8, maxlength: 40 });
  const begin = (bench, alone) => page.work("starting", async () => {
    await post(sessionPath(page.session, "/investigate"), { bench, budget: budget.value, without: data.without, one: alone });
    page.go("bench");
  });
  return card("Measure on the bench",
    h("div", { class: "row" }, data.benches.map((bench) => button(`Measure this on ${BENCHES[bench]}`, () => begin(bench, true), { class: "main", id: `measure-${bench}` }))),
    h("div", { class: "row" }, data.benches.map((bench) => button("Go on until one explanation is left", () => begin(bench, false), { id: `go-on-${bench}` })), h("label", { for: "budget" }, "within"), budget, h("span", { class: "note" }, "at the bench, in all")));
}

async function bring(body, page) {
  const brought = await page.work("diagnosing anew", () => post(sessionPath(page.session, "/answer"), body));
  if (!brought) return;
  refused.length = 0;
  picked.delete(page.session);
  await page.redraw(true);
  if (brought.notes?.length) page.complain(brought.notes.join(" "), "note");
}

function asValue(one, page) {
  const value = h("input", { type: "text", id: "answer-value", maxlength: 100, placeholder: `for example ${one.example}` });
  const submit = (event) => {
    event.preventDefault();
    bring({ value: `${one.answer}=${value.value.trim()}` }, page);
  };
  return card("Enter the value",
    h("form", { class: "fields", onsubmit: submit }, h("label", { for: "answer-value" }, one.answer), value, h("div", { class: "row wide" }, h("button", { type: "submit", class: "main", id: "bring" }, "Add this value"))),
    h("p", { class: "note" }, "With its uncertainty, if it is known: 21.3 mohm +- 0.1 mohm."));
}

function asFiles(data, one, page) {
  const input = h("input", { type: "file", multiple: true, id: "file-input", class: "unseen", tabindex: -1, "aria-hidden": "true", onchange: () => take([...input.files], page) });
  const value = one.example && h("input", { type: "text", id: "answer-condition", maxlength: 60, value: one.wished || one.example });
  const ready = data.files.files.some((file) => SWEEPS.has(file.used_as) && !file.trouble);
  const submit = () => bring({ condition: [one.answer, value && value.value.trim()].filter(Boolean).join("=") }, page);
  return card("Add the sweeps as files",
    h("div", { class: "drop-zone", id: "drop-zone" }, h("p", {}, `Drop ${TERMINATIONS[one.termination] ?? "the sweeps"} here, or `, button("choose files", () => input.click(), { id: "choose-files" }), input)),
    refused.length > 0 && h("ul", { id: "refused", role: "alert" }, refused.map((sentence) => h("li", { class: "bad" }, sentence))),
    data.files.files.length > 0 && filesRead(data.files, page),
    value && h("p", {}, h("label", {}, "What was set up: ", value)),
    h("div", { class: "row" }, button("Add these sweeps to the session", submit, { class: ready ? "main" : "", id: "bring", disabled: !ready })));
}

function explanations(data) {
  return card("Explanations",
    table(["explanation", "probability"], data.probabilities.map(([name, share]) => [name, h("div", { class: "row" }, h("meter", { min: 0, max: 1, value: share, "aria-label": `${name}: ${chance(share)}` }), chance(share))]), { id: "explanations" }));
}

function way(data) {
  const minutes = data.steps.reduce((sum, step) => sum + (step.minutes ?? 0), 0);
  return card("Measurements so far",
    table(["requested", "result", "minutes", "information (bits)", "then most probable"], data.steps.map((step) => [step.asked || "-", step.brought, show(step.minutes, "", 3), show(step.taught_bits, "", 2), step.then ? `${step.then[0]}: ${chance(step.then[1])}` : "-"]), { id: "way" }),
    minutes > 0 && h("p", { class: "note" }, `${show(minutes, "", 3)} minutes at the bench.`));
}

function alternatives(data, one, page) {
  const rest = [...(data.asked && one !== data.asked ? [data.asked] : []), ...data.alternatives.filter((other) => other !== one)];
  if (!rest.length) return "";
  const listed = (some, id) => table(["measurement", "what to do", "minutes", "bits expected", "instead"], some.map((other) => [other.id, other.instruction, show(other.minutes, "", 3), bits(other.information_bits), button("Choose", () => pick(other.id, page), { "aria-label": `choose ${other.id}` })]), { id });
  const worth = rest.filter((other) => other.information_bits >= LITTLE), others = rest.filter((other) => other.information_bits < LITTLE);
  return card("What else could be measured",
    worth.length > 0 && listed(worth, "alternatives"),
    others.length > 0 && h("details", {}, h("summary", {}, `${others.length} measurements that are not expected to tell the explanations apart`), listed(others, "of-little-use")));
}

const bits = (value) => (value < LITTLE ? `< ${LITTLE}` : show(value, "", 2));
