// Builds elements from text, never from markup, so that text from files or instruments cannot become elements.

export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value") element.value = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

// Cells shorter than this do not wrap, so that a value and its unit stay together.
const BRIEF = 24;
export const brief = (cell) => (typeof cell === "string" && cell.length < BRIEF ? "brief" : null);

export function table(head, rows, attributes = {}) {
  const cells = (kind, row) => row.map((cell) => (cell instanceof HTMLTableCellElement ? cell : h(kind, { class: brief(cell) }, cell)));
  return scroller(h("table", attributes,
    h("thead", {}, h("tr", {}, head.map((cell) => h("th", { scope: "col" }, cell)))),
    h("tbody", {}, rows.map((row) => (row instanceof HTMLTableRowElement ? row : h("tr", {}, cells("td", row)))))));
}

// A table of names and values without a head.
export function facts(rows, attributes = {}) {
  return scroller(h("table", attributes, h("tbody", {}, rows.map(([name, ...values]) => h("tr", {}, h("th", { scope: "row" }, name), values.map((value) => h("td", {}, value)))))));
}

// A table wider than its place can be focused, so that the arrow keys scroll it.
function scroller(inner) {
  const box = h("div", { class: "scroll" }, inner), reached = { tabindex: 0, role: "group", "aria-label": "Wide table: the arrow keys scroll it" };
  new ResizeObserver(() => {
    const wide = box.scrollWidth > box.clientWidth;
    for (const [name, value] of Object.entries(reached)) {
      if (wide) box.setAttribute(name, value);
      else box.removeAttribute(name);
    }
  }).observe(box);
  return box;
}

export function card(title, ...children) {
  return h("section", { class: "card" }, h("h2", {}, title), ...children);
}

export function button(text, action, attributes = {}) {
  return h("button", { type: "button", onclick: action, ...attributes }, text);
}
