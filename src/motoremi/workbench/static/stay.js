// A view that is drawn anew under its reader's hands: focus, what is being typed, zoom and marks stay where they were.

import { keptPlots, restorePlots } from "./plot.js";

const FOCUSABLE = "a[href], button, input, select, summary, [tabindex]";

// Call before the view is taken away; what it returns is called when the new one stands.
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
