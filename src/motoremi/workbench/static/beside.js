// The values of the curves at the cursor, beside the cursor. For screen readers the line below the plots says the same.

import { h } from "./dom.js";

const AWAY = 12;

// frame: {plot, label}; lines: texts, none to hide it.
export function besideCursor(frame, lines) {
  if (!frame.label?.isConnected) frame.plot.over.append(frame.label = h("div", { class: "beside-cursor", "aria-hidden": "true" }));
  const { label, plot } = frame;
  label.hidden = !lines.length;
  if (!lines.length) return;
  label.replaceChildren(...lines.map((line) => h("div", {}, line)));
  const { left } = plot.cursor, wide = plot.over.clientWidth;
  Object.assign(label.style, left > wide / 2 ? { left: "", right: `${wide - left + AWAY}px` } : { left: `${left + AWAY}px`, right: "" });
}
