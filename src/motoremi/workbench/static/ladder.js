// The ladder as falling steps: the error of each model, on a logarithmic scale, down to what noise and analyser would leave.

import { svg } from "./dom.js";
import { percent } from "./units.js";

const WIDTH = 640, HEIGHT = 190, LEFT = 12, RIGHT = 12, TOP = 34, BOTTOM = 30;

export function ladderDrawing(steps) {
  const floor = steps.at(-1).floor_percent;
  const errors = steps.map((step) => step.rms_error_percent);
  const high = Math.log10(Math.max(...errors) * 1.3), low = Math.log10(Math.min(floor, ...errors) * 0.7);
  const y = (value) => TOP + ((high - Math.log10(value)) / (high - low)) * (HEIGHT - TOP - BOTTOM);
  const wide = (WIDTH - LEFT - RIGHT) / steps.length;
  let path = `M${LEFT} ${y(errors[0])}`;
  const labels = [];
  steps.forEach((step, index) => {
    const from = LEFT + index * wide, level = y(step.rms_error_percent);
    path += `V${level}H${from + wide}`;
    const name = index === 0 ? "paper's circuit" : `+ ${step.added}`;
    labels.push(
      svg("text", { x: from + wide / 2, y: level - 18, class: "step-name" }, name),
      svg("text", { x: from + wide / 2, y: level - 4, class: "step-error" }, percent(step.rms_error_percent)));
  });
  const words = steps.map((step, index) => `${index === 0 ? "paper's circuit" : step.added}: ${percent(step.rms_error_percent)}`).join("; ");
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "ladder", role: "img", "aria-label": `Ladder of models. ${words}. Noise and analyser would leave ${percent(floor)}` },
    svg("path", { d: `M${LEFT} ${y(floor)}H${WIDTH - RIGHT}`, class: "floor" }),
    svg("text", { x: WIDTH - RIGHT, y: y(floor) + 16, class: "floor-name" }, `noise and analyser: ${percent(floor)}`),
    svg("path", { d: path, class: "steps" }),
    ...labels);
}
