// Take a session elsewhere: every file that 'motoremi export' writes.

import { fetchFile, get, sessionPath } from "./api.js";
import { button, card, h } from "./dom.js";

export function exportCard(page) {
  const list = h("ul", { id: "exports", class: "offers" });
  const box = card("Take it elsewhere", h("p", { class: "note" }, "For circuit simulators, network analysers' programs, spreadsheets and scripts."), list);
  fill(list, page);
  return box;
}

async function fill(list, page) {
  const session = page.session;
  const told = await page.attempt(() => get(sessionPath(session, "/export")));
  if (!told) return;
  const reasons = [...new Set(told.files.map((one) => one.missing).filter(Boolean))];
  list.replaceChildren(
    ...told.files.filter((one) => !one.missing).map(({ name, title }) => h("li", {},
      button(name, () => page.work(`writing ${name}`, () => save(sessionPath(session, `/export/${encodeURIComponent(name)}`), name)), { "data-export": name }), ` ${title}`)),
    h("li", {}, told.report.length ? "The report: " : h("span", { class: "note" }, "The report is written in the view Report."), told.report.flatMap((name) => [h("a", { href: sessionPath(session, `/report/${encodeURIComponent(name)}`), download: name }, name), " "])),
    ...reasons.map((reason) => h("li", { class: "note" }, `Not yet, ${reason}: ${told.files.filter((one) => one.missing === reason).map((one) => one.name).join(", ")}`)));
}

// What cannot be made is told in a sentence, so the file is fetched before it is offered to be saved.
export async function save(address, name) {
  const content = URL.createObjectURL(await fetchFile(address));
  h("a", { href: content, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(content), 10_000);
}
