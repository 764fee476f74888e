// The view Report: choose form and sections, write the report, open or download its files.

import { get, post, sessionPath, Trouble } from "../api.js";
import { button, card, h } from "../dom.js";

const FORMS = { long: "long: what an engineer works with", short: "short: the two pages that a customer reads" };
// For a profile and a logo; the workbench accepts no more.
const LARGEST = 2_000_000;
const KINDS = { html: "the report as a page", pdf: "the report on paper", json: "all data, for machines", csv: "parameters and bands, for a spreadsheet", xml: "verdicts as JUnit, for CI" };
// The choice is kept when the view is drawn again.
const chosen = { form: "long", sections: null };

export const report = {
  title: "Report",

  load: (page) => get(sessionPath(page.session, "/report")),

  draw(where, data, page) {
    const files = h("ul", { id: "report-files" }, data.files.map((name) => entry(page, name)));
    where.append(card("Report",
      h("p", {}, "The session as it is now: measurements, the model and where it fails, the missing effect, spectra and verdicts, and what was not done."),
      laboratory(data, page), choice(data, page), files));
    page.listeners.add((kind) => kind === "files" && page.redraw(true));
  },
};

// The laboratory: a profile, chosen together with the logo that it names.
function laboratory({ laboratory: name, choosable }, page) {
  const input = h("input", { type: "file", multiple: true, accept: ".toml,.svg,.png", id: "laboratory-files", class: "unseen", tabindex: -1, "aria-hidden": "true", onchange: () => choose([...input.files], page) });
  const says = name ? `Signed by ${name}.` : "No laboratory signs it yet: its profile says name, customer, number series and equipment, and may name a logo.";
  return h("div", {}, h("p", { class: "note", id: "who-signs" }, says),
    choosable && h("div", { class: "row" }, button(name ? "Choose another profile" : "Choose the laboratory's profile", () => input.click(), { id: "choose-laboratory" }), input,
      !name && h("a", { href: "/static/laboratory.toml", download: "laboratory.toml" }, "a profile to fill in")));
}

const choose = (files, page) => page.work("reading the profile", async () => {
  const large = files.find((file) => file.size > LARGEST);
  if (large) throw new Trouble(`${large.name}: is larger than 2 MB; a profile or logo must be smaller`);
  await post("/api/laboratory", { files: await Promise.all(files.map(async (file) => ({ name: file.name, data: await base64(file) }))) });
});

const base64 = (file) => new Promise((done, failed) => {
  const reader = new FileReader();
  reader.onload = () => done(reader.result.slice(reader.result.indexOf(",") + 1));
  reader.onerror = () => failed(new Trouble(`${file.name}: cannot be read; it may be a folder, or have been deleted`));
  reader.readAsDataURL(file);
});

function choice(data, page) {
  chosen.sections ??= new Set(Object.keys(data.sections));
  const boxes = h("fieldset", { class: "choices", id: "report-sections" }, h("legend", {}, "Sections"), Object.entries(data.sections).map(([name, text]) => h("label", { class: "row" },
    h("input", { type: "checkbox", value: name, checked: chosen.sections.has(name), onchange: (event) => (event.target.checked ? chosen.sections.add(name) : chosen.sections.delete(name)) }), `${name}: ${text}`)));
  const form = h("select", { id: "report-form", onchange: (event) => { chosen.form = event.target.value; update(); } }, data.forms.map((name) => h("option", { value: name, selected: name === chosen.form }, FORMS[name] ?? name)));
  const update = () => { boxes.hidden = chosen.form === "short"; };
  update();
  const write = (event) => {
    event.preventDefault();
    if (!chosen.sections.size && chosen.form !== "short") return page.complain("Choose at least one section of the report.");
    const all = chosen.form === "short" || chosen.sections.size === Object.keys(data.sections).length;
    return page.work("writing the report", () => post(sessionPath(page.session, "/report"), { form: chosen.form, sections: all ? [] : [...chosen.sections] }));
  };
  return h("form", { onsubmit: write }, h("div", { class: "row" }, h("label", {}, "Form ", form), h("button", { type: "submit", class: "main", id: "write-report" }, "Write the report")),
    h("details", {}, h("summary", {}, "Choose sections"), boxes));
}

function entry(page, name) {
  const address = sessionPath(page.session, `/report/${encodeURIComponent(name)}`);
  const look = name.endsWith(".html") && [" ", h("a", { href: `${address}?show=1`, target: "_blank", rel: "noopener" }, "open")];
  return h("li", {}, h("a", { href: address, download: name }, name), `: ${KINDS[name.split(".").at(-1)] ?? ""}`, look);
}
