// The view Bench: identify instruments, run a procedure, watch the sweeps arrive, answer prompts, stop.

import { get, post, sessionPath } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { Plots } from "../plot.js";
import { times } from "../progress.js";
import { term } from "../terms.js";
import { band } from "../units.js";

// Key in sessionStorage: the form's values survive a reload of this tab.
const FORM = "motoremi-bench";
const MEASURED = new Set(["sweep", "spectrum", "standard"]);

export const bench = {
  title: "Bench",
  follows: false,
  load: () => get("/api/bench"),

  draw(where, data, page) {
    const place = { data, page, traces: [] };
    place.live = h("div", {}, card("Run", h("p", { class: "note" }, "No run yet: what is measured is drawn here as it arrives.")))
    where.append(h("div", { class: "columns" }, h("div", {}, form(place)), place.live));
    if (page.run) drawRun(place);
    page.listeners.add((kind, data) => {
      if (kind === "run") drawState(place);
      else if (kind === "document") arrived(place, data);
    });
  },
};

function form(place) {
  const { data, page } = place;
  const kept = JSON.parse(sessionStorage.getItem(FORM)) ?? { procedure: "full_motor_test", bench: data.real ? "real" : "simulated", motor: "", serial: "", operator: data.operator, seed: 1, hides: "something", ask: false };
  const resume = page.resume;
  page.resume = null;
  const field = (name, input) => { input.id = `bench-${name}`; input.addEventListener("change", () => { kept[name] = input.type === "checkbox" ? input.checked : input.type === "number" ? Number(input.value) : input.value; update(); }); return input; };
  const select = (name, options) => field(name, h("select", {}, Object.entries(options).map(([value, text]) => h("option", { value, selected: value === kept[name] }, text))));
  const label = (text, id) => h("label", { for: `bench-${id}` }, text);
  const steps = h("div", { class: "wide" }), found = h("div", { class: "wide", id: "found" }), simulated = [];
  const only = (element) => { simulated.push(element); return element; };
  const update = () => {
    sessionStorage.setItem(FORM, JSON.stringify(kept));
    for (const element of simulated) element.hidden = kept.bench !== "simulated";
    const procedure = data.procedures.find((one) => one.name === kept.procedure);
    steps.replaceChildren(h("details", {}, h("summary", {}, `${procedure.steps.length} steps with ${Object.entries(procedure.instruments).map(([role, driver]) => `${role} ${driver}`).join(", ")}`),
      h("ol", {}, procedure.steps.map((step) => h("li", {}, `${step.do} ${Object.entries(step.parameters).map(([key, value]) => `${key} ${value}`).join(", ")}`)))));
  };
  const submit = (event) => {
    event.preventDefault();
    page.work("starting", async () => page.choose((await post("/api/run", kept)).session));
  };
  const look = async () => {
    const answers = await page.work("identifying the instruments", () => post("/api/bench/look", kept));
    if (!answers) return;
    found.replaceChildren(table(["role", "address", "instrument"], answers.found.map((one) => [one.role, one.resource, one.identity ? h("span", {}, Object.values(one.identity).join(" ")) : h("span", { class: "bad" }, one.trouble)])));
  };
  const hidden = { something: "something, chosen at random and not shown", nothing: "nothing", ...Object.fromEntries(Object.entries(data.hideable).map(([id, title]) => [id, `${id}: ${title}`])) };
  const box = card("Run a procedure",
    h("form", { class: "fields", onsubmit: submit },
      h("span", {}, label("Procedure", "procedure"), " ", term("procedure", "?")), select("procedure", Object.fromEntries(data.procedures.map((one) => [one.name, `${one.name}: ${one.title}`]))),
      steps,
      h("span", {}, label("Bench", "bench"), " ", term("bench", "?")), select("bench", { simulated: "simulated instruments and motor", ...(data.real ? { real: "the instruments of the bench file" } : {}) }),
      label("Motor", "motor"), field("motor", h("input", { type: "text", maxlength: 200, value: kept.motor, placeholder: "type" })),
      label("Serial number", "serial"), field("serial", h("input", { type: "text", maxlength: 200, value: kept.serial ?? "" })),
      h("span", {}, label("Operator", "operator"), " ", term("operator", "?")), field("operator", h("input", { type: "text", maxlength: 200, value: kept.operator })),
      only(h("span", {}, label("Number of the motor", "seed"), " ", term("seed", "?"))), only(field("seed", h("input", { type: "number", min: 0, step: 1, value: kept.seed }))),
      only(label("The motor hides", "hides")), only(select("hides", hidden)),
      only(h("label", { class: "wide" }, field("ask", h("input", { type: "checkbox", checked: kept.ask })), " ask me before each connection, as on a real bench")),
      h("div", { class: "row wide" }, h("button", { type: "submit", class: "main", id: "run" }, "Run"), button("Identify instruments", look, { id: "look" }),
        resume && button("Resume the interrupted run", () => page.work("resuming", () => post(sessionPath(resume.session, "/resume"), { ...kept, bench: resume.bench })), { class: "main", id: "resume" }))),
    found);
  update();
  return box;
}

function drawRun(place) {
  const { page } = place;
  place.session = page.run.session;
  place.heading = h("p", {});
  place.bar = h("progress", { max: 1 });
  place.status = h("p", { role: "status", id: "run-status" });
  place.prompt = h("div", { role: "alert", id: "prompt" });
  place.controls = h("div", { class: "row" });
  place.log = h("pre", { class: "log", id: "run-log", tabindex: 0, "aria-label": "What the run did" });
  place.plots?.destroy();
  place.plots = null;
  place.trace = card("What arrives", h("p", { class: "note", id: "arriving" }, "nothing measured yet"));
  place.live.replaceChildren(card("Run", place.heading, place.bar, place.status, place.prompt, place.controls, place.log), place.trace);
  for (const document of page.run.documents) note(place, document);
  const last = page.run.documents.filter((one) => MEASURED.has(one.kind)).at(-1);
  if (last) trace(place, last);
  drawState(place);
}

function drawState(place) {
  const { page } = place, run = page.run;
  if (!run) return;
  if (place.session !== run.session) {
    drawRun(place);
    return;
  }
  const progress = run.progress ?? {}, running = run.status === "running";
  place.heading.textContent = `${run.title} (${run.name})`;
  place.bar.hidden = !running;
  place.bar.value = progress.share ?? 0;
  place.status.textContent = running ? `${progress.doing ?? "starting"}${progress.doing ? `: ${times(progress)}` : ""}` : run.message;
  place.status.className = { done: "good", failed: "bad", stopped: "bad" }[run.status] ?? "";
  place.prompt.replaceChildren(...(run.prompt.length ? [h("div", { class: "card prompt" }, asked(run.prompt), h("div", { class: "row" }, run.example ? reading(page, run.example) : answer(page, "Done", "going on", "done", { class: "main", id: "connected" }), answer(page, "Not done", "ending the run: the instruments are made safe", "not done", { id: "not-done" }), answer(page, "Stop", "stopping: the instruments are made safe", "stop", { id: "stop-here" })))] : []));
  // Only one run at a time.
  document.getElementById("run").disabled = running;
  if (place.shown === `${run.session} ${run.status}`) return;
  place.shown = `${run.session} ${run.status}`;
  place.controls.replaceChildren(running
    ? button("Stop", () => page.work("stopping: the instruments are made safe", () => post("/api/run/stop")), { id: "stop" })
    : button("Show the session", async () => { await page.choose(run.session); page.go(run.shown_by); }, { class: "main", id: "show-session" }));
}

// The prompt: its sentence, wrapped as needed, and the drawing of the connections with its line breaks.
function asked(lines) {
  const blank = lines.findIndex((line) => !line.trim()), until = blank < 0 ? lines.length : blank;
  return [h("p", {}, lines.slice(0, until).join(" ")), until < lines.length && h("pre", {}, lines.slice(until + 1).join("\n"))];
}

// A value that the operator reads from another meter.
function reading(page, example) {
  const value = h("input", { type: "text", id: "reading", maxlength: 100, placeholder: `for example ${example}`, "aria-label": "value" });
  return h("form", { class: "row", onsubmit: (event) => { event.preventDefault(); page.work("going on", () => post("/api/run/answer", { value: value.value.trim() })); } },
    value, h("button", { type: "submit", class: "main", id: "give" }, "Enter"));
}

function answer(page, text, doing, word, attributes) {
  return button(text, () => page.work(doing, () => post("/api/run/answer", { answer: word })), attributes);
}

function arrived(place, document) {
  if (!place.log) return;
  note(place, document);
  if (MEASURED.has(document.kind)) trace(place, document);
}

async function trace(place, document) {
  const label = [document.termination, document.detector, document.standard, document.condition].filter(Boolean).join(" ");
  place.latest = document.seq;
  let data;
  try {
    data = await get(`/api/run/trace/${document.seq}`);
  } catch (trouble) {
    place.page.complain(trouble.message);
    return;
  }
  // A later sweep may have arrived while this one was read.
  if (place.latest !== document.seq || !place.trace.isConnected) return;
  place.plots?.destroy();
  place.plots = new Plots(place.trace);
  const [values, unit] = data.kind === "spectrum" ? [data.level_dbuv, "dBµV"] : [data.real.map((value, index) => Math.hypot(value, data.imag[index])), "Ω"];
  place.trace.querySelector("#arriving").textContent = `${label} ${document.kind}, ${document.points} points, ${band(...document.span_hz)} → ${document.file}`;
  place.plots.add(data.kind === "spectrum" ? "level" : "magnitude |Z|", data.frequency_hz, [{ label, values, color: "--measured" }], { unit, log: data.kind !== "spectrum", height: 260 });
}

function note(place, document) {
  const text = words(document);
  if (!text) return;
  place.log.append(`${document.time.slice(11, 19)} ${text}\n`);
  place.log.scrollTop = place.log.scrollHeight;
}

function words(document) {
  switch (document.kind) {
    case "step-start": return `[${document.step}/${document.of}] ${document.do} ${Object.values(document.parameters).join(" ")}`;
    case "instrument": return `  ${document.role}: ${Object.values(document.identity).join(" ")} at ${document.resource}`;
    case "sweep": case "spectrum": case "standard": return `  ${[document.termination, document.detector, document.standard, document.condition].filter(Boolean).join(" ")} ${document.kind}: ${document.points} points`;
    case "verdict": return `  ${document.do}: ${document.result.verdict ?? document.result.next_measurement?.id ?? ""} ${[...(document.result.effects ?? []), ...(document.result.serious_findings ?? [])].join(", ")}`;
    case "safe": return document.safe ? `  ${document.role} is in its safe state` : `  ${document.role} could NOT be brought into its safe state: ${document.problem}`;
    case "doubt": return document.says;
    case "asked": return `asked: ${document.order.instruction} (${document.minutes.toPrecision(3)} min)`;
    case "value": return `  value: ${document.name}`;
    case "answered": return `  information ${document.taught_bits.toPrecision(2)} bits; error so far ${document.error_percent.toPrecision(3)} %`;
    case "refused": return `  not done: ${document.id}`;
    case "resume": return `continuing at step ${document.step}`;
    case "stop": return `the run has ended: ${document.status} ${document.reason ?? ""}`;
    default: return "";
  }
}
