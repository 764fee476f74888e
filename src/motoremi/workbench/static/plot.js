// Plots over log frequency: drag to zoom, a cursor with values, two marks, all of it also by keyboard.

import { besideCursor } from "./beside.js";
import { button, h, svg } from "./dom.js";
import { savePicture, saveTable } from "./picture.js";
import { angleTicks, linearTicks, logTicks, tickLabels } from "./ticks.js";
import { show } from "./units.js";

/* global uPlot */

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const live = new Set();
const NARROW = 380;
// Omitted points are requested once the zoom has rested for this time.
const REST_MS = 150;

// A group of plots with common frequency axis, cursor and marks; all groups of a view share the zoom.
export class Plots {
  constructor(where) {
    this.where = where;
    this.plots = [];
    this.marks = { A: null, B: null };
    this.key = `plots${Math.random()}`;
    this.filled = "null";
    this.readout = h("p", { class: "readout", role: "status" }, "");
    this.host = h("div", { class: "plots", tabindex: 0, role: "group", "aria-label": "Plots: arrow keys move the cursor, + and - zoom, 0 shows all, A and B set marks", onkeydown: (event) => this.keydown(event), onfocusout: () => this.hush() });
    this.tools = h("div", { class: "tools" },
      button("Zoom in", () => this.zoom(0.5), { title: "+" }), button("Zoom out", () => this.zoom(2), { title: "-" }), button("Show all", () => this.all(), { title: "0" }),
      button("Mark A", () => this.mark("A"), { title: "A" }), button("Mark B", () => this.mark("B"), { title: "B" }),
      button("Save picture", () => savePicture(this), { title: "What is shown, as PNG" }), button("Save data", () => saveTable(this), { title: "What is shown, as CSV" }));
    // The number by which `stay` finds this group again.
    this.host.dataset.plots = live.size;
    where.append(this.tools, this.host, this.readout);
    live.add(this);
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(this.host);
  }

  // Add all frames, each the arguments of `add`. For thinned curves, ask(span) returns the same frames with the points of that span.
  draw(frames, ask = null) {
    for (const frame of frames) this.add(...frame);
    this.ask = ask;
  }

  // series: [{label, values, color, unit, width, dash, points, band}]; x in hertz. Without a height it fills its place.
  // Plots of one panel share their readout; `bare` leaves out legend or frequency labels.
  add(title, x, series, { log = false, unit = "", height = 230, digits = 4, panel = "", bare = {}, hold = false } = {}) {
    const caption = h("figcaption", {}, title, ...series.filter((one) => one.label && !bare.legend).map((one) => legend(one)));
    const holder = h("figure", {}, caption);
    this.host.append(holder);
    const frame = { holder, caption, title, x, series, unit, digits, log, height, panel, bare, hold };
    frame.plot = new uPlot(this.options(frame), [x, ...series.map((one) => one.values)], holder);
    this.plots.push(frame);
    return frame;
  }

  options(frame) {
    const axis = { stroke: color("--text"), grid: { stroke: color("--grid"), width: 1 }, ticks: { stroke: color("--soft"), width: 1 }, font: "12px system-ui, sans-serif" };
    return {
      ...sizeOf(frame), legend: { show: false }, focus: { alpha: 1 },
      // No horizontal cursor line: it would look like a limit.
      cursor: { y: false, sync: { key: this.key, setSeries: false }, drag: { x: true, y: false, setScale: true }, points: { size: 6 } },
      scales: {
        x: { distr: 3, time: false, range: (plot, low, high) => [low, high] },
        y: { distr: frame.log ? 3 : 1, range: (plot, low, high) => this.held(frame, plot, (frame.log ? logRange : padded)(low, high)) },
      },
      series: [{}, ...frame.series.map((one) => ({
        label: one.label, stroke: color(one.color), width: one.width ?? 1.5, dash: one.dash, spanGaps: false,
        points: { show: one.points ?? false, size: 4, stroke: color(one.color), fill: color(one.color) },
        paths: one.points ? () => null : undefined,
      }))],
      bands: frame.series.flatMap((one, index) => (one.band ? [{ series: [index + 1, index + 2], fill: color("--band") }] : [])),
      axes: [
        { ...axis, size: frame.bare.frequency ? 10 : 32, ...ticked(axis, logTicks, "Hz", (plot) => plot.width / 70, frame.bare.frequency) },
        { ...axis, size: frame.holder.clientWidth < NARROW ? 67 : 72, ...ticked(axis, frame.log ? logTicks : frame.unit === "°" ? angleTicks : linearTicks, frame.unit, (plot) => plot.height / 30) },
      ],
      hooks: {
        setCursor: [(plot) => this.moved(plot)],
        setScale: [(plot, name) => name === "x" && this.follow(plot)],
        draw: [(plot) => this.drawMarks(plot)],
      },
    };
  }

  // With `hold`, the range never shrinks while the whole span is shown, so that a falling error is seen to fall.
  held(frame, plot, [low, high]) {
    const [first, last] = [frame.x[0], frame.x.at(-1)], { min, max } = plot.scales.x;
    if (!frame.hold || min > first || max < last) return [low, high];
    frame.range = [Math.min(low, frame.range?.[0] ?? low), Math.max(high, frame.range?.[1] ?? high)];
    return frame.range;
  }

  moved(plot) {
    const index = plot.cursor.idx, frame = this.plots.find((one) => one.plot === plot);
    if (this.moving || !frame) return;
    const there = index !== null && index !== undefined && plot.cursor.left >= 0;
    if (there) {
      this.at = plot.data[0][index];
      this.panel = frame.panel;
      this.updateReadout();
    }
    besideCursor(frame, there && plot.over.matches(":hover") ? this.linesAt(frame) : []);
  }

  linesAt(frame) {
    const index = nearest(frame.x, this.at);
    return [show(frame.x[index], "Hz", 5), ...valuesOf(frame, index)];
  }

  hush() {
    for (const frame of this.plots) besideCursor(frame, []);
  }

  marked() {
    return this.marks.A !== null || this.marks.B !== null;
  }

  updateReadout() {
    if (this.at === undefined) return;
    const lines = [`${show(this.at, "Hz", 6)}: ${this.valuesAt(this.at)}`];
    const { A, B } = this.marks;
    if (A) lines.push(`A ${show(A, "Hz", 6)}: ${this.valuesAt(A)}`);
    if (B) lines.push(`B ${show(B, "Hz", 6)}: ${this.valuesAt(B)}`);
    if (A && B) lines.push(`B - A: ${show(B - A, "Hz", 5)}, ratio ${show(B / A, "", 5)}; ${this.changeFrom(A, B)}`);
    this.readout.textContent = lines.join("\n");
  }

  // The plots that share the readout.
  together() {
    return this.plots.filter((frame) => !this.panel || frame.panel === this.panel);
  }

  valuesAt(hertz) {
    return this.together().flatMap((frame) => valuesOf(frame, nearest(frame.x, hertz))).join(", ");
  }

  // How much the curves change between two frequencies.
  changeFrom(low, high) {
    return this.together().flatMap((frame) => {
      const [from, to] = [low, high].map((hertz) => nearest(frame.x, hertz));
      return frame.series.filter((one) => one.label && one.values[from] != null && one.values[to] != null && one.values[to] !== one.values[from]).map((one) => `${one.label} ${show(one.values[to] - one.values[from], frame.unit, frame.digits)}`);
    }).join(", ");
  }

  // All plots of the view show the same span.
  follow(plot) {
    if (this.following || plot.scales.x.min === null) return;
    this.following = true;
    for (const frame of this.plots) if (frame.plot !== plot) frame.plot.setScale("x", { min: plot.scales.x.min, max: plot.scales.x.max });
    this.following = false;
    this.lead(plot.scales.x);
    clearTimeout(this.resting);
    if (this.ask) this.resting = setTimeout(() => this.fill(), REST_MS);
  }

  // Make the other groups of the view show the same span, as far as they have it; a group that follows does not lead in turn.
  lead({ min, max }) {
    if (this.led === `${min} ${max}`) return;
    this.led = "";
    const zoomed = this.zoomed();
    for (const other of live) {
      if (other === this || !other.plots.length) continue;
      const [first, last] = other.whole(), [low, high] = zoomed ? [Math.max(min, first), Math.min(max, last)] : [first, last];
      if (low >= high) continue;
      other.led = `${low} ${high}`;
      other.span(low, high);
    }
  }

  // Load the omitted points of the shown span.
  async fill() {
    const span = this.zoomed(), key = JSON.stringify(span);
    if (key === this.filled) return;
    this.filled = key;
    const frames = await this.ask(span);
    if (!frames || this.filled !== key || !live.has(this)) return;
    frames.forEach(([, x, series], index) => this.change(this.plots[index], series, x));
  }

  span(low, high) {
    this.plots[0]?.plot.setScale("x", { min: low, max: high });
  }

  zoom(factor) {
    const scale = this.plots[0]?.plot.scales.x;
    if (!scale) return;
    const [low, high] = this.whole(), middle = Math.log(this.at && this.at > scale.min && this.at < scale.max ? this.at : Math.sqrt(scale.min * scale.max));
    this.span(Math.max(low, Math.exp(middle + factor * (Math.log(scale.min) - middle))), Math.min(high, Math.exp(middle + factor * (Math.log(scale.max) - middle))));
  }

  whole() {
    return [Math.min(...this.plots.map((frame) => frame.x[0])), Math.max(...this.plots.map((frame) => frame.x.at(-1)))];
  }

  // The shown span, if it is not the whole one.
  zoomed() {
    const scale = this.plots[0]?.plot.scales.x;
    if (!scale) return null;
    const [low, high] = this.whole();
    return scale.min > low || scale.max < high ? [scale.min, scale.max] : null;
  }

  all() {
    this.span(...this.whole());
  }

  mark(name) {
    this.marks[name] = this.at ?? Math.sqrt(this.whole()[0] * this.whole()[1]);
    this.at ??= this.marks[name];
    this.updateReadout();
    for (const frame of this.plots) frame.plot.redraw(false);
  }

  drawMarks(plot) {
    const { ctx, bbox } = plot, { A, B } = this.marks, first = A !== null && B !== null && B < A ? "B" : "A";
    for (const [name, hertz] of Object.entries(this.marks)) {
      if (hertz === null || hertz < plot.scales.x.min || hertz > plot.scales.x.max) continue;
      const x = plot.valToPos(hertz, "x", true);
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = color("--mark");
      ctx.lineWidth = 1;
      ctx.setLineDash([]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      // The letter is on the outer side of its line, on a background: marks may be close together.
      const px = devicePixelRatio, wide = ctx.measureText(name).width + 6 * px, left = name === first && x - wide > bbox.left;
      ctx.fillStyle = color("--card");
      ctx.fillRect(left ? x - wide - px : x + px, bbox.top, wide, 15 * px);
      ctx.fillStyle = color("--mark");
      ctx.textAlign = "center";
      ctx.fillText(name, left ? x - wide / 2 - px : x + wide / 2 + px, bbox.top + 12 * px);
      ctx.restore();
    }
  }

  move(by) {
    const frame = this.plots.find((one) => !this.panel || one.panel === this.panel);
    if (!frame) return;
    const at = this.at === undefined ? Math.floor(frame.x.length / 2) : nearest(frame.x, this.at);
    const index = Math.min(frame.x.length - 1, Math.max(0, at + by));
    this.at = frame.x[index];
    this.moving = true;
    for (const one of this.plots) one.plot.setCursor({ left: one.plot.valToPos(this.at, "x"), top: 10 });
    this.moving = false;
    for (const one of this.plots) besideCursor(one, one === frame ? this.linesAt(one) : []);
    this.updateReadout();
  }

  keydown(event) {
    const wide = event.shiftKey ? 20 : 1;
    const keys = {
      ArrowLeft: () => this.move(-wide), ArrowRight: () => this.move(wide), "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2),
      0: () => this.all(), a: () => this.mark("A"), b: () => this.mark("B"),
    };
    const action = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    action();
  }

  resize() {
    for (const frame of this.plots) {
      const size = sizeOf(frame);
      if (frame.holder.clientWidth && (frame.plot.width !== size.width || frame.plot.height !== size.height)) frame.plot.setSize(size);
    }
  }

  // Replace the curves of a frame; the shown span is kept.
  change(frame, series, x = frame.x) {
    frame.series = series;
    frame.x = x;
    const { min, max } = frame.plot.scales.x;
    frame.plot.batch(() => {
      frame.plot.setData([frame.x, ...series.map((one) => one.values)], false);
      frame.plot.setScale("x", { min, max });
    });
  }

  destroy() {
    live.delete(this);
    clearTimeout(this.resting);
    this.watch.disconnect();
    for (const frame of this.plots) frame.plot.destroy();
    this.plots = [];
    this.tools.remove();
    this.host.remove();
    this.readout.remove();
  }
}

// Redraw all plots after a change of theme: colours are read when a plot is made.
export function repaint() {
  for (const group of live) {
    for (const frame of group.plots) {
      const { min, max } = frame.plot.scales.x;
      const data = frame.plot.data;
      frame.plot.destroy();
      frame.plot = new uPlot(group.options(frame), data, frame.holder);
      frame.plot.setScale("x", { min, max });
    }
  }
}

// Zoom, cursor and marks of a view's plots, for when the view is drawn again.
export function keptPlots() {
  return [...live].map((group) => ({ at: group.at, marks: group.marks, span: group.zoomed() }));
}

export function restorePlots(kept) {
  [...live].forEach((group, index) => {
    if (!kept[index] || !group.plots.length) return;
    group.at = kept[index].at;
    group.marks = kept[index].marks;
    if (kept[index].span) group.span(...kept[index].span);
    group.updateReadout();
  });
}

function sizeOf({ holder, caption, height }) {
  return { width: Math.max(200, holder.clientWidth - 2), height: height ?? Math.max(64, holder.clientHeight - caption.offsetHeight - 2) };
}

export function leaveAll() {
  for (const group of [...live]) group.destroy();
}

export function legend(one) {
  // Drawn with the curve's dashes, which distinguish curves without colour.
  const dashes = one.points ? "0 7" : (one.dash ?? []).join(" ");
  return h("span", { class: `legend c${one.color.slice(1)}` }, svg("svg", { viewBox: "0 0 26 6", "aria-hidden": "true" }, svg("line", { x1: 2, y1: 3, x2: 25, y2: 3, "stroke-width": one.points ? 4 : 2.5, "stroke-dasharray": dashes, "stroke-linecap": one.points ? "round" : "butt" })), one.label);
}

const valuesOf = (frame, index) => frame.series.filter((one) => one.label && one.values[index] != null).map((one) => `${one.label} ${show(one.values[index], frame.unit, frame.digits)}`);

function nearest(x, value) {
  let low = 0, high = x.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle;
    else high = middle;
  }
  return value - x[low] < x[high] - value ? low : high;
}

// The ticks of an axis: a grid line for labelled ticks, a short mark for minor ones.
function ticked(axis, ticks, unit, most, bare = false) {
  const at = (plot, side) => ticks(...bounds(plot, side), most(plot));
  const bounds = (plot, side) => { const { min, max } = plot.scales[plot.axes[side].scale]; return [min, max]; };
  return {
    splits: (plot, side, low, high) => ticks(low, high, most(plot)).all,
    filter: (plot, splits) => splits,
    values: (plot, splits, side) => (bare ? splits.map(() => "") : tickLabels(splits, at(plot, side).labelled, unit)),
    grid: { ...axis.grid, filter: (plot, splits, side) => { const { labelled } = at(plot, side); return splits.map((value) => (labelled.has(value) ? value : null)); } },
    ticks: { ...axis.ticks, size: 6, filter: (plot, splits) => splits },
  };
}

function padded(low, high) {
  if (low === null || high === null) return [0, 1];
  const margin = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

function logRange(low, high) {
  if (!(low > 0) || !(high > 0)) return [0.1, 10];
  const margin = Math.max((high / low) ** 0.06, 1.05);
  return [low / margin, high * margin];
}
