// The view Next: the measurement that would best separate the remaining candidates.

import { get, sessionPath } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { term } from "../terms.js";
import { share, show } from "../units.js";

export const next = {
  title: "Next",
  needs: "diagnosis",
  without: "What to measure next follows from a diagnosis: diagnose this session first (view Story).",

  load: (page) => get(sessionPath(page.session, "/next")),

  draw(where, data, page) {
    const procedure = data.procedure?.replace(/\.toml$/, "");
    where.append(card("Measure next",
      h("p", { class: "large", id: "next-id" }, data.id),
      data.action && h("p", { id: "what-to-do" }, h("strong", {}, "What to do: "), `${data.action}.`), h("p", { class: "sentence" }, data.why), h("p", {}, term("next measurement", "How it was found")),
      procedure && button(`Set up ${procedure} on the bench`, () => { page.procedure = procedure; page.go("bench"); }, { class: "main" }),
      !procedure && data.action && h("p", { class: "note" }, "No procedure of the bench does this: it is done by hand.")));
    if (data.menu?.length) {
      where.append(card("What else could be measured",
        table(["measurement", "what to do", "minutes", "bits expected", "pairs distinguished"], data.menu.map((one) => [one.id, one.action, show(one.minutes, "", 3), show(one.information_bits, "", 2), share(one.separates)]))));
    }
  },
};
