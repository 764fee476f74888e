// Export a session: every file that 'motoremi export' writes.

import { fetchFile, get, sessionPath } from "./api.js";
import { button, card, h } from "./dom.js";

export function exportCard(page) {
  const list = h("ul", { id: "exports", class: "offers" });
  const box = card("Export", h("p", { class: "note" }, "For circuit simulators, network analysers' programs, spreadsheets and scripts."), list);
  fill(list, page);
  return box;
}

async function fill(list, page) {
  const session = page.session;
  const offered = await page.attempt(() => get(sessionPath(session, "/export")));
  if (!offered) return;
  const reasons = [...new Set(offered.files.map((one) => one.missing).filter(Boolean))];
  list.replaceChildren(
    ...offered.files.filter((one) => !one.missing).map(({ name, title }) => h("li", {},
      button(name, () => page.work(`writing ${name}`, () => save(sessionPath(session, `/export/${encodeURIComponent(name)}`), name)), { "data-export": name }), ` ${title}`)),
    h("li", {}, offered.report.length ? "The report: " : h("span", { class: "note" }, "The report is written in the view Report."), offered.report.flatMap((name) => [h("a", { href: sessionPath(session, `/report/${encodeURIComponent(name)}`), download: name }, name), " "])),
    ...reasons.map((reason) => h("li", { class: "note" }, `Not yet, ${reason}: ${offered.files.filter((one) => one.missing === reason).map((one) => one.name).join(", ")}`)));
}

// Fetched before it is offered for saving, so that a failure is shown as a sentence.
export async function save(address, name) {
  const content = URL.createObjectURL(await fetchFile(address));
  h("a", { href: content, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(content), 10_000);
}
