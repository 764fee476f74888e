// Technical terms: dotted underline, explained on hover and on focus.

import { get } from "./api.js";
import { h } from "./dom.js";

let terms = {};
const tip = () => document.getElementById("tip");

export async function loadTerms() {
  terms = await get("/api/terms");
  document.addEventListener("mouseover", (event) => point(event.target));
  document.addEventListener("focusin", (event) => point(event.target));
}

export function term(name, shown = name) {
  return h("dfn", { "data-term": name, tabindex: 0, "aria-describedby": "tip" }, shown);
}

export function hideTip() {
  tip().hidden = true;
}

function point(target) {
  const about = target.closest?.("[data-term]");
  const text = about && terms[about.dataset.term];
  tip().hidden = !text;
  if (!text) return;
  tip().textContent = text;
  const place = about.getBoundingClientRect();
  const width = Math.min(360, innerWidth - 16);
  tip().style.width = `${width}px`;
  tip().style.left = `${Math.max(8, Math.min(place.left, innerWidth - width - 8))}px`;
  const below = place.bottom + 6;
  const high = tip().offsetHeight;
  tip().style.top = `${below + high > innerHeight ? Math.max(4, place.top - high - 6) : below}px`;
}
