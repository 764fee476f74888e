// The view Files: make a session from files, open a session, compare several.

import { get, post } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { refused, take } from "../drop.js";
import { term } from "../terms.js";
import { when } from "../units.js";
import { compare } from "./together.js";

// Key in sessionStorage: the form's values survive a reload of this tab.
const FORM = "motoremi-files";
const FIELDS = {
  motor: ["Motor", "type and serial number"], name: ["Name of the session", "as the motor's, if left empty"], accuracy: ["Accuracy in %", "not stated"], band: ["Band", "all; or 150kHz:30MHz"], operator: ["Operator", ""],
};
const USES = { short: "short-circuit sweep", open: "open-circuit sweep", spectrum: "spectrum", corrections: "corrections", "leave out": "leave out" };
const chosen = new Set();

export const files = {
  title: "Files",
  key: "0",

  load: () => get("/api/files"),

  draw(where, data, page) {
    where.append(h("div", { class: "columns" }, h("div", {}, dropped(data, page)), h("div", {}, sessions(page))));
    page.listeners.add((kind) => (kind === "files" || kind === "sessions") && page.redraw(true));
  },
};

function dropped(data, page) {
  const input = h("input", { type: "file", multiple: true, id: "file-input", class: "unseen", tabindex: -1, "aria-hidden": "true", onchange: () => take([...input.files], page) });
  return card("Make a session from files",
    h("div", { class: "drop-zone", id: "drop-zone" },
      h("p", {}, "Drop sweeps and spectra here, or ", button("choose files", () => input.click(), { class: data.files.length ? "" : "main", id: "choose-files" }), input),
      h("p", { class: "note" }, "CSV, Touchstone, and the formats of analysers and receivers; also a corrections file (TOML) with its tables. Nothing is stored before you make a session.")),
    refused.length > 0 && h("ul", { id: "refused", role: "alert" }, refused.map((sentence) => h("li", { class: "bad" }, sentence))),
    data.files.length > 0 && filesRead(data, page),
    data.files.length > 0 && form(data, page));
}

// The files read so far, each with its use.
export function filesRead(data, page) {
  const act = (doing, path, body) => page.work(doing, async () => { await post(`/api/files${path}`, body); await page.redraw(true); });
  const row = (one) => {
    const use = h("select", { id: `use-${one.id}`, "aria-label": `use ${one.name} as`, onchange: (event) => act("reading", `/${one.id}`, { used_as: event.target.value }) },
      one.choices.map((name) => h("option", { value: name, selected: name === one.used_as }, USES[name])));
    const remarks = [one.trouble && h("p", { class: "bad" }, one.trouble.replace(`${one.name}: `, "")), ...(one.notes ?? []).map((text) => h("p", { class: "note" }, text))];
    return h("tr", {},
      h("td", {}, h("strong", {}, one.name), h("div", { class: "note" }, [one.kind, one.points && `${one.points} points`, one.span, one.format, one.analyser && `analyser ${one.analyser}`].filter(Boolean).join(" · ")), remarks),
      h("td", {}, use),
      h("td", {}, button("Remove", () => act("removing", `/${one.id}/remove`), { "aria-label": `remove ${one.name}` })));
  };
  const ports = data.files.some((one) => /\.s2p$/i.test(one.name));
  const fixture = h("select", { id: "fixture", onchange: (event) => act("reading", "/fixture", { fixture: event.target.value }) },
    h("option", { value: "", disabled: true, selected: !data.fixture }, "choose"), data.fixtures.map((name) => h("option", { value: name, selected: name === data.fixture }, name)));
  return h("div", {},
    table(["file", "use as", "remove"], data.files.map(row), { id: "files-read" }),
    ports && h("p", {}, h("label", {}, "Connection of the motor to the two ports (reflection: port 1 alone) ", fixture)),
    h("div", { class: "row" }, button("Remove all", () => act("removing", "/clear"), { id: "clear-files" })));
}

function form(data, page) {
  const kept = JSON.parse(sessionStorage.getItem(FORM)) ?? {};
  const keep = (name, property = "value") => (event) => { kept[name] = event.target[property]; sessionStorage.setItem(FORM, JSON.stringify(kept)); };
  const label = (name, text) => h("label", { for: `import-${name}` }, text);
  const field = ([name, [text, hint]]) => [label(name, text), h("input", { type: "text", id: `import-${name}`, maxlength: 200, value: kept[name] ?? "", placeholder: hint, oninput: keep(name) })];
  const analyser = h("select", { id: "import-analyser", onchange: keep("analyser") },
    h("option", { value: "" }, "as the files say, or not known"), Object.entries(data.analysers).map(([name, title]) => h("option", { value: name, selected: name === kept.analyser }, `${name}: ${title}`)));
  const compensated = h("input", { type: "checkbox", id: "import-compensated", checked: kept.compensated ?? false, onchange: keep("compensated", "checked") });
  const submit = async (event) => {
    event.preventDefault();
    const made = await page.work("making the session", () => post("/api/files/session", kept));
    if (!made) return;
    sessionStorage.removeItem(FORM);
    refused.length = 0;
    await page.work("reading", () => page.choose(made.session));
    page.go("story");
  };
  const [motor, ...others] = Object.entries(FIELDS);
  return h("form", { class: "fields", onsubmit: submit },
    field(motor), h("span", {}, label("analyser", "Analyser"), " ", term("analyser", "?")), analyser,
    h("label", { class: "wide" }, compensated, " calibrated at the motor's terminals, or the fixture compensated"), others.flatMap(field),
    h("div", { class: "row wide" }, h("button", { type: "submit", class: "main", id: "make-session" }, "Make session")));
}

function sessions(page) {
  if (!page.sessions.length) return card("Sessions", h("p", { class: "note" }, "None yet. Make one from files, or by a run on the bench (view Bench)."));
  const start = button("Compare chosen sessions", () => compare([...chosen], page), { id: "compare", disabled: true });
  const count = () => { start.disabled = chosen.size < 2; start.className = chosen.size < 2 ? "" : "main"; };
  for (const id of chosen) if (!page.sessions.some((one) => one.id === id)) chosen.delete(id);
  count();
  const row = (one) => h("tr", one.id === page.session ? { "aria-current": "true" } : {},
    h("td", {}, h("input", { type: "checkbox", id: `compare-${one.id}`, "aria-label": `compare ${one.motor || one.name}`, checked: chosen.has(one.id), onchange: (event) => { if (event.target.checked) chosen.add(one.id); else chosen.delete(one.id); count(); } })),
    h("td", {}, button(one.motor || one.name, async () => { await page.work("reading", () => page.choose(one.id)); page.go("story"); }, { "data-session": one.id }), one.motor && h("div", { class: "note" }, one.name)),
    h("td", { class: "brief" }, when(one.began)), h("td", { class: "brief" }, one.state));
  return card("Sessions",
    h("p", { class: "note" }, "Open one, or choose two or more to compare with the one chosen first."),
    table(["compare", "motor", "began", "state"], page.sessions.map(row), { id: "sessions" }),
    h("div", { class: "row" }, start));
}
