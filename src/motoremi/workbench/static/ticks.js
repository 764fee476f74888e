// Positions and labels of axis ticks.

import { prefixed } from "./units.js";

const ANGLES = [5, 15, 45, 90, 180];

// Ticks of an axis over decades: 1-2-5 (or whole decades) get a label, the others of 1 to 9 are minor.
export function logTicks(low, high, most) {
  if (!(low > 0) || high / low <= 8) return linearTicks(low, high, most);
  const decades = Math.log10(high / low), every = Math.max(1, Math.ceil(decades / most)), leads = decades * 3 <= most ? [1, 2, 5] : [1];
  // On a low axis the marks from 6 to 9 would run into each other.
  const minors = decades * 1.5 > most ? [1, 2, 5] : [1, 2, 3, 4, 5, 6, 7, 8, 9];
  const all = [], labelled = new Set(), first = Math.floor(Math.log10(low));
  for (let power = first; power <= Math.ceil(Math.log10(high)); power++) {
    for (const lead of minors) {
      const value = Number(`${lead}e${power}`);
      if (value < low || value > high) continue;
      all.push(value);
      if (leads.includes(lead) && (power - first) % every === 0) labelled.add(value);
    }
  }
  return { all, labelled };
}

export function linearTicks(low, high, most) {
  const rough = (high - low) / Math.max(2, Math.min(6, most)), unit = 10 ** Math.floor(Math.log10(rough));
  return stepped(low, high, [1, 2, 5, 10].map((lead) => lead * unit).find((one) => one >= rough * (1 - 1e-9)));
}

// Angles have ticks at multiples of 45 and 90 degrees where they fit.
export function angleTicks(low, high, most) {
  const step = ANGLES.find((one) => (high - low) / one <= most);
  return !step || high - low < 2 * step ? linearTicks(low, high, most) : stepped(low, high, step);
}

function stepped(low, high, step) {
  const all = [];
  for (let count = Math.ceil(low / step - 1e-9); count * step <= high + 1e-9 * step; count++) all.push(Number((count * step).toPrecision(12)));
  return { all, labelled: new Set(all) };
}

// One prefix for an axis that does not span decades, and enough decimals to distinguish neighbouring labels.
export function tickLabels(values, labelled, unit) {
  const shown = values.filter((value) => labelled.has(value));
  const steps = shown.slice(1).map((value, index) => value - shown[index]);
  // Two labels alone may belong to a logarithmic axis: if they are decades apart, each has its own prefix.
  const even = steps.length > 0 && Math.max(...steps) < 1.5 * Math.min(...steps) && (shown.length > 2 || !(shown[1] >= 10 * shown[0]));
  const largest = Math.max(...shown.map(Math.abs));
  return values.map((value) => (labelled.has(value) ? prefixed(value, unit, even ? { scale: largest, step: steps[0] } : {}) : ""));
}
