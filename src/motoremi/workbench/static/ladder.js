// The ladder as falling steps: the error of each model on a logarithmic scale, down to what noise would leave. One row for each, so that no label meets another.

import { h } from "./dom.js";

const SHORTEST = 3;

export function ladderDrawing(steps, { base, floorName, write }) {
  const floor = steps.at(-1).floor, errors = steps.map((step) => step.error);
  const high = Math.log(Math.max(floor, ...errors)), low = Math.log(Math.min(floor, ...errors));
  const row = (tag, name, value, kind) => {
    const bar = h("span", { class: "bar" });
    bar.style.width = `${SHORTEST + (high > low ? ((Math.log(value) - low) / (high - low)) * (100 - SHORTEST) : 0)}%`;
    return h(tag, {}, h("span", { class: `${kind}-name`, title: name }, name), h("span", { class: "way", "aria-hidden": true }, bar), h("span", { class: `${kind}-error` }, write(value)));
  };
  return h("div", { class: "ladder" },
    h("ol", { "aria-label": "Ladder of models" }, steps.map((step, index) => row("li", index ? `+ ${step.added}` : base, step.error, "step"))),
    row("p", floorName, floor, "floor"));
}
