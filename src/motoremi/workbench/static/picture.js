// Save what a group of plots shows, as a picture or as a table.

import { h } from "./dom.js";

const HEAD = 44, FOOT = 18, MARGIN = 8, SWATCH = 22;
const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const FORMULA = /^[=+\-@\t\r]/;

// The plots as shown on the screen, with titles, legend, the session's name and the marks.
export function savePicture(group) {
  const shown = group.plots.filter((frame) => frame.holder.clientWidth), around = group.host.getBoundingClientRect(), density = window.devicePixelRatio || 1;
  const lines = group.marked() ? group.readout.textContent.split("\n") : [];
  const canvas = document.createElement("canvas"), context = canvas.getContext("2d");
  canvas.width = (around.width + 2 * MARGIN) * density;
  canvas.height = (around.height + HEAD + FOOT * lines.length + 2 * MARGIN) * density;
  context.scale(density, density);
  context.fillStyle = color("--card");
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.translate(MARGIN, MARGIN);
  context.textBaseline = "middle";
  write(context, [sessionName()], 0, 10, "bold 13px system-ui, sans-serif");
  const all = new Map(shown.flatMap((frame) => frame.series.filter((one) => one.label).map((one) => [one.label, one])));
  let x = 0;
  for (const one of all.values()) x = key(context, one, x, 32);
  for (const frame of shown) {
    const box = frame.holder.getBoundingClientRect(), plot = frame.plot.ctx.canvas.getBoundingClientRect(), down = HEAD - around.top;
    write(context, [frame.title], box.left - around.left, box.top + down + 8);
    context.drawImage(frame.plot.ctx.canvas, plot.left - around.left, plot.top + down, plot.width, plot.height);
  }
  lines.forEach((line, index) => write(context, [line], 0, HEAD + around.height + FOOT * (index + 0.5)));
  canvas.toBlob((content) => save(content, "png"));
}

// One row for each drawn point within the shown span.
export function saveTable(group) {
  const rows = ["plot,curve,unit,frequency_hz,value"];
  for (const { x, series, title, unit, plot } of group.plots) {
    const { min, max } = plot.scales.x;
    for (const one of series.filter(({ label }) => label)) {
      x.forEach((hertz, index) => {
        if (hertz >= min && hertz <= max && one.values[index] != null) rows.push([cell(title), cell(one.label), cell(unit), hertz, one.values[index]].join(","));
      });
    }
  }
  save(new Blob([rows.join("\r\n"), "\r\n"], { type: "text/csv" }), "csv");
}

function write(context, texts, x, y, font = "12px system-ui, sans-serif") {
  context.font = font;
  context.fillStyle = color("--text");
  for (const text of texts) context.fillText(text, x, y);
}

// Draw one entry of the legend; returns where the next one begins.
function key(context, one, x, y) {
  context.strokeStyle = color(one.color);
  context.lineWidth = one.points ? 4 : 2;
  context.setLineDash(one.points ? [3, 4] : one.dash ?? []);
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x + SWATCH, y);
  context.stroke();
  context.setLineDash([]);
  write(context, [one.label], x + SWATCH + 5, y);
  return x + SWATCH + 5 + context.measureText(one.label).width + 14;
}

// Escaped, so that no spreadsheet reads text as a formula.
const cell = (text) => `"${(FORMULA.test(text) ? `'${text}` : text).replace(/"/g, '""')}"`;

const sessionName = () => document.getElementById("session-choice").selectedOptions[0]?.title ?? "";

function save(content, ending) {
  const name = [sessionName() || "motoremi", document.getElementById("main").dataset.view].join("-").replace(/[^\w.-]+/g, "-");
  const address = URL.createObjectURL(content);
  h("a", { href: address, download: `${name}.${ending}` }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
