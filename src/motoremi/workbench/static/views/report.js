// The report: choose its form, write it, look at it, take its files.

import { get, post, sessionPath, Trouble } from "../api.js";
import { button, card, h } from "../dom.js";

const FORMS = { long: "long: what an engineer works with", short: "short: the two pages that a customer reads" };
// A profile and a logo; the workbench takes no more.
const LARGEST = 2_000_000;
const KINDS = { html: "the report as a page", pdf: "the report on paper", json: "all data, for machines", csv: "parameters and bands, for a spreadsheet", xml: "verdicts as JUnit, for CI" };
// What is chosen stays so when the view is drawn anew.
const chosen = { form: "long", sections: null };

export const report = {
  title: "Report",

  load: (page) => get(sessionPath(page.session, "/report")),

  draw(where, told, page) {
    const files = h("ul", { id: "report-files" }, told.files.map((name) => entry(page, name)));
    where.append(card("Report",
      h("p", {}, "Everything as it stands now: what was measured, the model and where it fails, which effect is missing, spectra and verdicts, what was not done."),
      laboratory(told, page), choice(told, page), files));
    page.listeners.add((kind) => kind === "files" && page.redraw(true));
  },
};

// Who signs: a profile, chosen together with the logo that it names.
function laboratory({ laboratory: name, choosable }, page) {
  const input = h("input", { type: "file", multiple: true, accept: ".toml,.svg,.png", id: "laboratory-files", class: "unseen", tabindex: -1, "aria-hidden": "true", onchange: () => choose([...input.files], page) });
  const says = name ? `Signed by ${name}.` : "No laboratory signs it yet: its profile says name, customer, number series and equipment, and may name a logo.";
  return h("div", {}, h("p", { class: "note", id: "who-signs" }, says),
    choosable && h("div", { class: "row" }, button(name ? "Choose another profile" : "Choose the laboratory's profile", () => input.click(), { id: "choose-laboratory" }), input,
      !name && h("a", { href: "/static/laboratory.toml", download: "laboratory.toml" }, "a profile to fill in")));
}

const choose = (files, page) => page.work("reading the profile", async () => {
  const large = files.find((file) => file.size > LARGEST);
  if (large) throw new Trouble(`${large.name}: is larger than 2 MB, which no profile and no logo is`);
  await post("/api/laboratory", { files: await Promise.all(files.map(async (file) => ({ name: file.name, data: await base64(file) }))) });
});

const base64 = (file) => new Promise((done, failed) => {
  const reader = new FileReader();
  reader.onload = () => done(reader.result.slice(reader.result.indexOf(",") + 1));
  reader.onerror = () => failed(new Trouble(`${file.name}: cannot be read; is it a folder, or gone?`));
  reader.readAsDataURL(file);
});

function choice(told, page) {
  chosen.sections ??= new Set(Object.keys(told.sections));
  const boxes = h("fieldset", { class: "choices", id: "report-sections" }, h("legend", {}, "Sections"), Object.entries(told.sections).map(([name, text]) => h("label", { class: "row" },
    h("input", { type: "checkbox", value: name, checked: chosen.sections.has(name), onchange: (event) => (event.target.checked ? chosen.sections.add(name) : chosen.sections.delete(name)) }), `${name}: ${text}`)));
  const form = h("select", { id: "report-form", onchange: (event) => { chosen.form = event.target.value; update(); } }, told.forms.map((name) => h("option", { value: name, selected: name === chosen.form }, FORMS[name] ?? name)));
  const update = () => { boxes.hidden = chosen.form === "short"; };
  update();
  const write = (event) => {
    event.preventDefault();
    if (!chosen.sections.size && chosen.form !== "short") return page.complain("Choose at least one section of the report.");
    const all = chosen.form === "short" || chosen.sections.size === Object.keys(told.sections).length;
    return page.work("writing the report", () => post(sessionPath(page.session, "/report"), { form: chosen.form, sections: all ? [] : [...chosen.sections] }));
  };
  return h("form", { onsubmit: write }, h("div", { class: "row" }, h("label", {}, "Form ", form), h("button", { type: "submit", class: "main", id: "write-report" }, "Write the report")),
    h("details", {}, h("summary", {}, "Choose sections"), boxes));
}

function entry(page, name) {
  const address = sessionPath(page.session, `/report/${encodeURIComponent(name)}`);
  const look = name.endsWith(".html") && [" ", h("a", { href: `${address}?show=1`, target: "_blank", rel: "noopener" }, "look at it")];
  return h("li", {}, h("a", { href: address, download: name }, name), `: ${KINDS[name.split(".").at(-1)] ?? ""}`, look);
}
