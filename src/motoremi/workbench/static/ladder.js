// The ladder: one row for each model with its error on a logarithmic scale, down to the floor, the error that noise and analyser would leave. A click on a step goes back
// to it; a click on a dropped step puts back all steps up to it.

import { button, h } from "./dom.js";

const SHORTEST = 3;

export function ladderDrawing(steps, dropped, { base, floorName, write, back, again }) {
  const floor = steps.at(-1).floor, errors = [...steps, ...dropped].map((step) => step.error);
  const high = Math.log(Math.max(floor, ...errors)), low = Math.log(Math.min(floor, ...errors));
  const row = (tag, name, value, kind, go, attributes = {}) => {
    const bar = h("span", { class: "bar" });
    bar.style.width = `${SHORTEST + (high > low ? ((Math.log(value) - low) / (high - low)) * (100 - SHORTEST) : 0)}%`;
    const named = go ? button(name, go.action, { class: `${kind}-name`, title: go.does }) : h("span", { class: `${kind}-name`, title: name }, name);
    return h(tag, attributes, named, h("span", { class: "way", "aria-hidden": true }, bar), h("span", { class: `${kind}-error` }, write(value)));
  };
  const nameOf = (step, index) => (index ? `+ ${step.added}` : base), last = steps.length - 1;
  return h("div", { class: "ladder" },
    h("ol", { "aria-label": "Ladder of models" },
      steps.map((step, index) => row("li", nameOf(step, index), step.error, "step", index < last && { action: () => back(last - index), does: `Go back to ${nameOf(step, index)}` }, index < last ? {} : { "aria-current": "step" })),
      dropped.map((step, index) => row("li", `+ ${step.added}`, step.error, "dropped", { action: () => again(index + 1), does: `Dropped: put back ${step.added}` }))),
    row("p", floorName, floor, "floor"));
}
