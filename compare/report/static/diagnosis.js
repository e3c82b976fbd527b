// The page of a diagnosis: residual charts with their noise band and held-out blocks, the residual map under the pointer
// or the arrow keys, and blocks of text to copy.
"use strict";

// A chart that draws of many samples what the screen can show.
class Thinned extends Chart {
  drawSeries(s, parent, x, y) {
    super.drawSeries(this.scales && s.x.length > 4 * this.scales.width ? thinned(s, x) : s, parent, x, y);
  }
}

// A chart that shades what lies behind its lines.
class Residuals extends Thinned {
  axes(x, y, width, height) {
    const clamp = (v, {start, end}) => Math.min(Math.max(v, Math.min(start, end)), Math.max(start, end));
    const shade = (kind, left, right, top, bottom) => {
      const [a, b, c, d] = [clamp(left, x), clamp(right, x), clamp(top, y), clamp(bottom, y)];
      if (b > a && d > c) svg("rect", {x: a, y: c, width: b - a, height: d - c, class: kind}, this.svg);
    };
    const {held, limit} = this.options;
    for (const [from, to] of held) shade("held", Math.min(x(from), x(to)), Math.max(x(from), x(to)), y.end, y.start);
    shade("band", x.start, x.end, y(limit), y(-limit));
    super.axes(x, y, width, height);
  }
}

// Of each pixel column the first, lowest, highest and last sample, in order.
function thinned(s, x) {
  const kept = [];
  for (let i = 0; i < s.x.length; ) {
    const column = Math.round(x(s.x[i]));
    let [low, high, j] = [i, i, i];
    for (; j < s.x.length && Math.round(x(s.x[j])) === column; j++) {
      if (!known(s.y[j])) continue;
      if (!known(s.y[low]) || s.y[j] < s.y[low]) low = j;
      if (!known(s.y[high]) || s.y[j] > s.y[high]) high = j;
    }
    const last = Math.max(j - 1, i);
    kept.push(...[...new Set([i, low, high, last])].sort((a, b) => a - b));
    i = last + 1;
  }
  return {...s, x: kept.map((i) => s.x[i]), y: kept.map((i) => s.y[i])};
}

function residualFigure(panel, run, number) {
  const series = ["before", "after"].map((side) => ({name: side, x: run.x, y: panel[side], role: colours[side], mark: "line", level: 0, labels: [], scale: true}));
  const limit = data.band * panel.noise, ends = [run.x[0], run.x.at(-1)];
  for (const v of [limit, -limit]) series.push({name: "", x: ends, y: [v, v], role: "frame", mark: "dashed", level: 0, labels: [], scale: true});
  return {name: `residual-${number}`, title: panel.title, summary: panel.summary, kind: "curves", x: {label: run.label, unit: run.unit}, y: {label: "measured − simulated", unit: panel.unit}, series};
}

// Measured and simulated over each other: simulated is measured less the residual, and its line breaks where an angle
// goes over half a turn from one sample to the next.
function valuesFigure(panel, run, number) {
  const simulated = (side) => {
    const found = panel.measured.map((m, i) => (known(m) && known(panel[side][i]) ? m - panel[side][i] / panel.per : null));
    return panel.half ? found.map((v, i) => (i && known(v) && known(found[i - 1]) && Math.abs(v - found[i - 1]) > panel.half ? null : v)) : found;
  };
  const line = (name, y, role, mark) => ({name, x: run.x, y, role, mark, level: 0, labels: [], scale: true});
  const series = [line("measured", panel.measured, "analytic", "link"), ...["before", "after"].map((side) => line(side, simulated(side), colours[side], "line"))];
  return {name: `values-${number}`, title: `${panel.title}, measured and simulated`, summary: `Measured and simulated over ${run.label}.`, kind: "curves", x: {label: run.label, unit: run.unit}, y: {label: panel.label, unit: panel.measuredUnit}, series};
}

// Every sample of a panel as a table, made when somebody opens it.
function samples(details, panel, run) {
  const table = html("table", {}, html("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": `Data: ${panel.title}`}, details));
  const head = html("tr", {}, html("thead", {}, table)), body = html("tbody", {}, table);
  const titles = [`${run.label} (${run.unit})`, `measured (${panel.measuredUnit})`, `measured − before (${panel.unit})`, `measured − after (${panel.unit})`, ...(run.held_out ? ["held out"] : [])];
  for (const title of titles) html("th", {scope: "col"}, head, title);
  run.x.forEach((x, i) => {
    const row = html("tr", {}, body);
    html("th", {scope: "row"}, row, number(x, 6));
    html("td", {}, row, number(panel.measured[i], 7));
    for (const side of ["before", "after"]) html("td", {}, row, number(panel[side][i]));
    if (run.held_out) html("td", {}, row, run.held_out[i] ? "yes" : "");
  });
}

// ---------------------------------------------------------------------- the map

class ResidualMap {
  constructor(place, about) {
    Object.assign(this, {place, about, at: null});
    this.rows = [...place.querySelectorAll("tr[data-strip]")];
    this.tip = html("div", {class: "tip", hidden: ""}, place);
    this.live = html("p", {class: "unseen", "aria-live": "polite"}, place);
    this.spots = [0, 1].map(() => html("span", {class: "spot", hidden: ""}, place));
    place.addEventListener("pointermove", (event) => this.point(event));
    place.addEventListener("pointerleave", () => this.clear());
    place.addEventListener("blur", () => this.clear());
    place.addEventListener("keydown", (event) => this.key(event));
  }

  point(event) {
    const cell = event.target.closest("td.cells");
    if (!cell) return this.clear();
    const box = cell.querySelector("svg").getBoundingClientRect();
    const row = this.rows.indexOf(cell.parentElement), count = this.about.strips[row].before.length;
    this.show(row, Math.min(Math.max(Math.floor(((event.clientX - box.left) / box.width) * count), 0), count - 1), cell);
  }

  key(event) {
    if (event.target !== this.place) return;
    const step = {ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0]}[event.key];
    if (!step) return event.key === "Escape" ? this.clear() : undefined;
    const [row, column] = this.at ?? [0, -step[1]];
    const last = this.about.strips[0].before.length - 1;
    this.show(Math.min(Math.max(row + step[0], 0), this.rows.length - 1), Math.min(Math.max(column + step[1], 0), last), null);
    this.live.textContent = this.tip.innerText;
    event.preventDefault();
  }

  show(row, column, cell) {
    this.at = [row, column];
    const {strips, low, high, unit, label} = this.about, strip = strips[row], count = strip.before.length;
    const edge = (i) => number(Number((low + ((high - low) * i) / count).toPrecision(4)));
    const say = (v) => (known(v) ? `${number(v, 3)} σ` : "no samples");
    this.tip.replaceChildren();
    html("strong", {}, this.tip, strip.title);
    html("span", {}, this.tip, `${label} ${edge(column)} to ${edge(column + 1)} ${unit}`);
    for (const side of ["before", "after"]) html("b", {}, html("span", {}, this.tip, `${side} `), say(strip[side][column]));
    this.tip.hidden = false;
    const cells = [...this.rows[row].querySelectorAll("td.cells")], around = this.place.getBoundingClientRect();
    cells.forEach((td, k) => {
      td.append(this.spots[k]);
      const box = td.querySelector("svg").getBoundingClientRect();
      this.spots[k].style.left = `${((column + 0.5) / count) * box.width}px`;
      this.spots[k].hidden = false;
    });
    const box = (cell ?? cells[0]).querySelector("svg").getBoundingClientRect();
    const left = box.left - around.left + ((column + 0.5) / count) * box.width, top = box.bottom - around.top + 6;
    this.tip.style.left = `${Math.max(0, Math.min(left + 10, around.width - this.tip.offsetWidth - 4))}px`;
    this.tip.style.top = `${top}px`;
  }

  clear() {
    this.at = null;
    this.tip.hidden = true;
    for (const spot of this.spots) spot.hidden = true;
  }
}

// ---------------------------------------------------------------------- the page

const data = JSON.parse(document.getElementById("data").textContent);
const colours = data.colours;
document.querySelectorAll("[data-panel]").forEach((place) => {
  const i = Number(place.dataset.panel), panel = data.panels[i], run = data.runs[panel.run];
  new Thinned(document.getElementById(`values-${i}`), valuesFigure(panel, run, i));
  new Residuals(place, residualFigure(panel, run, i), {held: run.held, limit: data.band * panel.noise});
  const details = place.closest("figure").querySelector("details");
  details.addEventListener("toggle", () => details.open && !details.querySelector("table") && samples(details, panel, run));
});
document.querySelectorAll("[data-map]").forEach((place) => new ResidualMap(place, data.maps[Number(place.dataset.map)]));
document.querySelectorAll(".copy").forEach((place) => {
  const button = html("button", {type: "button"}, place, "Copy"), text = place.querySelector("code");
  button.addEventListener("click", async () => {
    getSelection().selectAllChildren(text);
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "Copied";
    } catch {
      button.textContent = "Selected"; // where a page may not write the clipboard, the keyboard can
    }
  });
});
const reveal = () => {
  const found = location.hash && document.getElementById(location.hash.slice(1));
  const run = found && found.closest("details.run");
  if (run && !run.open) {
    run.open = true;
    found.scrollIntoView();
  }
};
addEventListener("hashchange", reveal);
document.documentElement.classList.add("ready");
reveal();
