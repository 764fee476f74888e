// The report: write it, look at it, take its files.

import { get, post, sessionPath } from "../api.js";
import { button, card, h } from "../dom.js";

const KINDS = { html: "the report as a page", pdf: "the report on paper", json: "all data, for machines", csv: "parameters and bands, for a spreadsheet", xml: "verdicts as JUnit, for CI" };

export const report = {
  title: "Report",

  load: (page) => get(sessionPath(page.session, "/report")),

  draw(where, told, page) {
    const files = h("ul", { id: "report-files" }, told.files.map((name) => entry(page, name)));
    const write = () => page.work("writing the report", () => post(sessionPath(page.session, "/report")));
    where.append(card("Report",
      h("p", {}, "Identity, sweeps, model, where it fails, ladder, ranking, spectra, what was not done, and the next measurement, as they stand now."),
      button("Write the report", write, { class: "main", id: "write-report" }), files));
  },
};

function entry(page, name) {
  const address = sessionPath(page.session, `/report/${encodeURIComponent(name)}`);
  const look = name.endsWith(".html") && [" ", h("a", { href: `${address}?show=1`, target: "_blank", rel: "noopener" }, "look at it")];
  return h("li", {}, h("a", { href: address, download: name }, name), `: ${KINDS[name.split(".").at(-1)] ?? ""}`, look);
}
