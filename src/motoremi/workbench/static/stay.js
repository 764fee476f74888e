// Keeps focus, typed text, zoom and marks when a view is drawn again.

import { keptPlots, restorePlots } from "./plot.js";

const FOCUSABLE = "a[href], button, input, select, summary, [tabindex]";

// Call before the view is removed; call what it returns when the new one is in place.
export function stay(where) {
  const plots = keptPlots(), put = focusIn(where);
  return () => {
    restorePlots(plots);
    put();
  };
}

function focusIn(where) {
  const at = document.activeElement;
  if (!where.contains(at) || at === where) return () => {};
  const text = at.textContent, index = [...where.querySelectorAll(FOCUSABLE)].indexOf(at);
  const typed = at.matches("input:not([type=checkbox])") ? at.value : null;
  return () => {
    const all = [...where.querySelectorAll(FOCUSABLE)];
    const same = (at.id && document.getElementById(at.id)) || (at.dataset.plots && all.find((one) => one.dataset.plots === at.dataset.plots)) || all.find((one) => at.dataset.effect && one.dataset.effect === at.dataset.effect)
      || (all[index]?.tagName === at.tagName && all[index].textContent === text ? all[index] : all.find((one) => text && one.tagName === at.tagName && one.textContent === text));
    if (!same) return;
    if (typed !== null) same.value = typed;
    same.focus({ preventScroll: true });
  };
}
