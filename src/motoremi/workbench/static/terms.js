// Technical terms: dotted underline, explained on hover and on focus.

import { get } from "./api.js";
import { h } from "./dom.js";

let terms = {};
const tip = () => document.getElementById("tip");

export async function loadTerms() {
  terms = await get("/api/terms");
  // When the page scrolls, elements move under a pointer at rest. So an explanation is hidden only
  // when the pointer leaves its term, and that of the focused term is then shown again.
  document.addEventListener("mouseover", (event) => named(event.target) && explain(event.target));
  document.addEventListener("mouseout", (event) => named(event.target) && explain(document.activeElement));
  document.addEventListener("focusin", (event) => explain(event.target));
}

export function term(name, shown = name) {
  return h("dfn", { "data-term": name, tabindex: 0, "aria-describedby": "tip" }, shown);
}

export function hideTip() {
  tip().hidden = true;
}

function named(target) {
  return target?.closest?.("[data-term]");
}

function explain(target) {
  const about = named(target);
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
