// The view Challenge: a sealed motor; first your answer, then the hidden effect and the diagnosis of the program.

import { get, post, sessionPath } from "../api.js";
import { button, card, h, table } from "../dom.js";
import { term } from "../terms.js";
import { share } from "../units.js";

// The view may be drawn anew while the first fit goes on.
let fitting = null;

export const challenge = {
  title: "Challenge",

  async load(page) {
    if (!page.session) return {};
    if (!page.head.challenge) return {};
    if (page.head.sealed) {
      if (!page.head.ladder.length) {
        fitting ??= post(sessionPath(page.session, "/fit")).finally(() => { fitting = null; });
        await fitting;
        await page.refresh();
      }
      return { sealed: await get(sessionPath(page.session, "/story?of=impedance")) };
    }
    return { revealed: await get(sessionPath(page.session, "/challenge")) };
  },

  draw(where, data, page) {
    where.append(card("A sealed motor", h("p", {}, term("challenge", "How this works"), ": a simulated motor may hide one effect, two effects, one that is not in the catalogue, or nothing. Look at the sweeps, try effects, then answer."),
      button("New challenge", () => begin(page), { id: "new-challenge", class: data.sealed ? "" : "main" })));
    if (data.sealed) where.append(answer(data.sealed, page));
    if (data.revealed) where.append(score(data.revealed));
  },
};

async function begin(page) {
  const made = await page.work("making a sealed motor", () => post("/api/challenge"));
  if (!made) return;
  await page.work("reading", () => page.choose(made.session));
  await page.redraw();
}

// The choice is kept when the view is drawn again.
const ticked = new Map();

function answer(data, page) {
  if (!ticked.has(page.session)) ticked.set(page.session, new Set());
  const chosen = ticked.get(page.session);
  const box = (value, text) => h("label", { class: "row" }, h("input", { type: "checkbox", value, checked: chosen.has(value), onchange: (event) => (event.target.checked ? chosen.add(value) : chosen.delete(value)) }), text);
  const give = (names) => async () => {
    const done = await page.work("diagnosing the same motor", () => post(sessionPath(page.session, "/challenge"), { answer: names ?? [...chosen] }));
    if (done) await page.redraw();
  };
  return card("Your answer",
    h("p", {}, "What does this motor hide? The views Story, Session, Fails and Inspect work as for any other motor."),
    h("div", { class: "row" }, button("Nothing is missing", give(["adequate"]), { id: "say-adequate" }), button("Something that is not in the catalogue", give(["unexplained"]))),
    h("fieldset", { class: "choices" }, h("legend", {}, "or one or two effects"), data.catalogue.filter((one) => !one.accumulates).map((one) => box(one.id, `${one.id}: ${one.title}`))),
    button("Answer with the chosen effects", give(null), { class: "main", id: "say-effects" }));
}

function score(data) {
  const tool = data.tool.answer;
  const toolSaid = tool.effects.length ? `${tool.effects.join(" + ")}${tool.families.length ? ` (not distinguished: ${tool.families.map((one) => one.join(", ")).join("; ")})` : ""}` : tool.verdict;
  const mood = (outcome) => h("span", { class: outcome === "right" || outcome === "family" ? "good" : "bad" }, outcome);
  return card("The seal is open",
    h("p", { class: "large", id: "hidden" }, data.hidden.length ? data.hidden.join(" + ") : "nothing was hidden"),
    table(["who", "answer", "outcome"], [["you", data.yours.answer.join(" + "), mood(data.yours.outcome)], ["the tool", `${toolSaid}, confidence ${share(tool.confidence)}`, mood(data.tool.outcome)]], { id: "score" }));
}
