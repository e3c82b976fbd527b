// Charts of a report: the same figure data as the SVG files, drawn at the size of the screen, with a cursor to read
// values, zoom (drag a box, or the buttons, or + and - keys), a legend that hides series, and the data as a table.
"use strict";

const SVG = "http://www.w3.org/2000/svg";
const DASHES = ["", "7 4", "2 3", "9 3 2 3"];
const SHAPES = {ideal: "plus", "massless-link": "circle", "spring-damper": "square", contact: "cross", analytic: "dot"};
const SIZES = {dot: 3.5, circle: 5.5, square: 4};
const GLYPHS = {
  circle: (r) => `m${r} 0a${r} ${r} 0 1 0 ${-2 * r} 0a${r} ${r} 0 1 0 ${2 * r} 0`,
  square: (r) => `m${-r} ${-r}h${2 * r}v${2 * r}h${-2 * r}z`,
  plus: (r) => `m${-r} 0h${2 * r}m${-r} ${-r}v${2 * r}`,
  cross: (r) => `m${-r} ${-r}l${2 * r} ${2 * r}m${-2 * r} 0l${2 * r} ${-2 * r}`,
  dot: (r) => `m${-r} 0h${2 * r}m${-r} ${-r}v${2 * r}`,
  pivot: (r) => `m0 0l${r} ${1.5 * r}h${-2 * r}z`,
};

// Where a label may stand beside its point: how far to the right (or left, or in the middle over it), its base line
// below the point, and what that costs.
const places = (aside, over, under, line) => Array.from({length: 14}, (_, k) => k).flatMap((k) => {
  const rows = [[-over - line * k, 4 * k], [under + line * k, 4 * k + 1], ...(k ? [] : [[4, 3]])];
  return rows.flatMap(([row, cost]) => [0, 14, 30, 50].flatMap((more) => [[aside + Math.sign(aside) * more, row, cost + more / 5], [-aside - Math.sign(aside) * more, row, cost + more / 5 + 0.5]]).concat([[0, row + (row < 0 ? -4 : 2), cost + 2 + 9 * (row === 4)]]));
});
const PEAK_PLACES = places(9, 8, 18, 13), JOINT_PLACES = places(-11, 10, 20, 15);

// Points along lines some pixels from each other, one where several meet.
function between(lines) {
  const found = new Map();
  for (const at of lines) at.slice(1).forEach((q, i) => {
    const p = at[i], n = p && q ? Math.min(300, Math.ceil(Math.hypot(q[0] - p[0], q[1] - p[1]) / 4)) : 0;
    for (let k = 0; k < n; k++) {
      const point = [p[0] + ((q[0] - p[0]) * k) / n, p[1] + ((q[1] - p[1]) * k) / n];
      found.set(point.map((v) => Math.round(v / 4)).join(), point);
    }
  });
  return [...found.values()];
}

function make(namespace, tag, attributes = {}, parent = null, text = null) {
  const found = namespace ? document.createElementNS(namespace, tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) found.setAttribute(name, value);
  if (text !== null) found.textContent = text;
  if (parent) parent.append(found);
  return found;
}
const svg = (tag, attributes, parent, text = null) => make(SVG, tag, attributes, parent, text);
const html = (tag, attributes, parent, text = null) => make(null, tag, attributes, parent, text);

const known = (v) => v !== null && v !== undefined;
const superscript = (n) => String(n).replace(/[-0-9]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);

function number(value, digits = 4) {
  if (!known(value)) return "–";
  const [mantissa, power] = Number(value.toPrecision(digits)).toString().split("e");
  const small = value !== 0 && Math.abs(value) < 1e-4 && power === undefined;
  const text = small ? value.toExponential(digits - 1).split("e") : [mantissa, power];
  return text[0].replace("-", "−") + (text[1] ? `×10${superscript(Number(text[1]))}` : "");
}

// As many digits as tell some numbers apart, four at least.
function apart(values, most = 10) {
  const different = new Set(values).size;
  let digits = 4;
  while (digits < most && new Set(values.map((v) => number(v, digits))).size < different) digits++;
  return digits;
}

function ticks(low, high, count, degrees) {
  const rough = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = degrees && rough > 10 ? [15, 30, 45, 60, 90, 180, 360] : [power, 2 * power, 5 * power, 10 * power];
  const step = steps.find((s) => s >= rough * 0.999) ?? steps.at(-1) * Math.ceil(rough / steps.at(-1));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k <= Math.floor(high / step + 1e-9); k++) found.push(k * step);
  return found.length < 2 && count < 9 ? ticks(low, high, count + 1, degrees) : {values: found, step}; // one number is no scale
}

function exponent(largest) {
  return largest === 0 || (largest >= 1e-2 && largest < 1e5) ? 0 : 3 * Math.floor(Math.log10(largest) / 3);
}

function extent(values, margin) {
  if (!values.length) return [0, 1];
  const low = values.reduce((a, b) => Math.min(a, b)), high = values.reduce((a, b) => Math.max(a, b));
  const least = margin ? 1e-4 * Math.max(Math.abs(low), Math.abs(high)) : 0; // what rounding does is no curve
  const spare = Math.max(margin * (high - low), least) || margin;
  return [low - spare, high + spare];
}

class Chart {
  constructor(place, figure, options = {}) {
    Object.assign(this, {place, figure, options, hidden: new Set(), zoomed: null, cursor: null, marked: null});
    this.legend = html("div", {class: "legend"}, place);
    this.frame = html("div", {class: "frame"}, place);
    this.tip = html("div", {class: "tip", hidden: ""}, this.frame);
    this.live = html("p", {class: "unseen", "aria-live": "polite"}, place);
    if (!this.panelled) this.tools();
    if (!this.panelled) this.listLegend();
    new ResizeObserver(() => this.draw()).observe(this.frame);
  }

  update(figure) {
    const names = (f) => f.series.map((s) => s.name).join("\n");
    const other = names(figure) !== names(this.figure);
    this.figure = figure;
    if (other) this.listLegend();
    this.draw();
  }

  // A dashed line at another chart's or the slider's position.
  mark(x) {
    this.marked = x;
    if (this.scales && this.figure.kind === "curves") this.markLine.setAttribute("d", `M${this.scales.x(x)} ${this.scales.y.start}V${this.scales.y.end}`);
  }

  // Of small multiples it is one, at the scale of them all.
  get panelled() {
    return this.options.panel !== undefined;
  }

  shown() {
    if (this.panelled) return this.figure.series.filter((s) => [this.options.panel, -1].includes(s.level)).map((s) => ({...s, level: 0}));
    return this.figure.series.filter((s) => !this.hidden.has(s.name));
  }

  // ------------------------------------------------------------------ controls

  tools() {
    const bar = html("div", {class: "tools"}, this.place);
    const button = (text, label, act) => html("button", {type: "button", title: label, "aria-label": `${label}: ${this.figure.title}`}, bar, text).addEventListener("click", act);
    button("+", "Zoom in", () => this.zoom(0.6));
    button("−", "Zoom out", () => this.zoom(1 / 0.6));
    button("Reset", "Reset zoom", () => this.reset());
  }

  listLegend() {
    this.legend.replaceChildren();
    for (const s of this.figure.series.filter((s) => s.name)) {
      const button = html("button", {type: "button", "aria-pressed": String(!this.hidden.has(s.name)), title: "Show or hide"}, this.legend);
      const key = svg("svg", {width: 26, height: 16, "aria-hidden": "true"}, button);
      const line = s.mark === "marker" ? {x: [13], y: [8]} : {x: [1, 25], y: [8, 8]};
      this.drawSeries({...s, ...line, mark: s.mark === "band" ? "link" : s.mark, labels: []}, key, (v) => v, (v) => v);
      button.append(s.name);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(s.name)) this.hidden.add(s.name);
        button.setAttribute("aria-pressed", String(!this.hidden.has(s.name)));
        this.draw();
      });
    }
  }

  zoom(by) {
    const {x, y} = this.scales;
    const at = this.cursor ?? (x.low + x.high) / 2, plane = this.figure.kind === "plane";
    const narrow = (low, high, middle) => [middle - (middle - low) * by, middle + (high - middle) * by];
    const up = plane || this.zoomed?.y ? narrow(y.low, y.high, (y.low + y.high) / 2) : null;
    this.zoomed = {x: narrow(x.low, x.high, Math.min(Math.max(at, x.low), x.high)), y: up};
    this.draw();
  }

  reset() {
    this.zoomed = null;
    this.draw();
  }

  // ------------------------------------------------------------------ drawing

  ranges() {
    const scaling = this.panelled ? this.figure.series.filter((s) => s.name || !this.options.close) : this.shown().filter((s) => s.scale);
    const [xs, ys] = ["x", "y"].map((axis) => scaling.flatMap((s) => s[axis].filter(known)));
    if (this.figure.kind === "curves") {
      const reach = 4 * ys.reduce((a, b) => Math.max(a, Math.abs(b)), 0);
      const limits = this.shown().filter((s) => !s.scale).flatMap((s) => s.y.filter((v) => Math.abs(v) <= reach));
      return {x: this.zoomed?.x ?? extent(xs, 0.015), y: this.zoomed?.y ?? extent(ys.concat(limits), 0.06)};
    }
    const fixed = this.options.range;
    const [left, right] = extent(xs, 0), [low, high] = extent(ys, 0);
    const spare = 0.1 * Math.max(right - left, high - low);
    return {
      x: this.zoomed?.x ?? fixed?.x ?? [left - spare, right + spare],
      y: this.zoomed?.y ?? fixed?.y ?? [low - spare, high + spare],
    };
  }

  layout() {
    const width = this.frame.clientWidth, narrow = width < 480;
    const left = this.panelled ? 50 : narrow ? 60 : 68, right = 12, top = this.panelled ? 16 : 10, bottom = this.panelled ? 24 : 46;
    let {x, y} = this.ranges();
    let height = this.panelled ? 150 : narrow ? 260 : 330;
    if (this.figure.kind === "plane") {
      const wide = width - left - right;
      const aspect = (y[1] - y[0]) / (x[1] - x[0]);
      const tall = Math.min(Math.max(wide * aspect, 170), this.options.tallest ?? 430);
      height = tall + top + bottom;
      const perUnit = Math.min(wide / (x[1] - x[0]), tall / (y[1] - y[0]));
      const around = ([a, b], size) => [(a + b - size / perUnit) / 2, (a + b + size / perUnit) / 2];
      [x, y] = [around(x, wide), around(y, tall)];
    }
    const scale = ([low, high], start, end) => Object.assign((v) => start + ((v - low) / (high - low)) * (end - start), {low, high, start, end, back: (p) => low + ((p - start) / (end - start)) * (high - low)});
    this.scales = {x: scale(x, left, width - right), y: scale(y, height - bottom, top), width, height};
    return this.scales;
  }

  draw() {
    if (!this.frame.clientWidth) return;
    const {x, y, width, height} = this.layout();
    const active = document.activeElement === this.svg;
    this.svg?.remove();
    this.svg = svg("svg", {width, height, viewBox: `0 0 ${width} ${height}`, tabindex: "0", role: "img", "aria-label": `${this.figure.title}. ${this.figure.summary}`, class: "chart"}, null);
    this.frame.prepend(this.svg);
    this.axes(x, y, width, height);
    const id = `area-${this.place.id}`;
    svg("rect", {x: x.start, y: y.end, width: x.end - x.start, height: y.start - y.end}, svg("clipPath", {id}, this.svg));
    const area = svg("g", {"clip-path": `url(#${id})`}, this.svg);
    this.markLine = svg("path", {class: "mark"}, area);
    if (this.marked !== null) this.mark(this.marked);
    for (const s of this.shown()) this.drawSeries(s, area, x, y);
    this.labels(area, x, y);
    this.over = svg("g", {}, this.svg);
    this.listen();
    if (active) this.svg.focus({preventScroll: true});
  }

  // Names of joints, and what peaks are: within the area, where they cover least of curves, markers and each other, a
  // peak's below that of a higher one beside it.
  labels(area, x, y) {
    const points = this.shown().map((s) => ({s, at: s.x.map((v, i) => (known(v) && known(s.y[i]) ? [x(v), y(s.y[i])] : null))}));
    const marks = points.filter(({s}) => ["marker", "joint", "pivot"].includes(s.mark)).flatMap(({at}) => at.filter(Boolean));
    const curves = marks.length && this.shown().some((s) => s.mark === "marker") ? between(points.filter(({s}) => ["line", "dashed"].includes(s.mark)).map(({at}) => at)) : [];
    const named = points.flatMap(({s, at}) => (s.labels ?? []).map((name, i) => ({name, at: at[i], peak: s.mark === "marker"})));
    const inside = ({at}) => at && at[0] >= x.start - 1 && at[0] <= x.end + 1 && at[1] >= y.end - 1 && at[1] <= y.start + 1;
    const placed = [];
    for (const {name, at: [px, py], peak} of named.filter(inside).sort((a, b) => a.at[1] - b.at[1])) {
      const text = svg("text", {class: peak ? "peak" : "label"}, area, name), wide = text.getComputedTextLength();
      let best = {cost: Infinity};
      for (const [side, up, away] of peak ? PEAK_PLACES : JOINT_PLACES) {
        const left = Math.max(x.start + 2, Math.min(px + side - (side < 0 ? wide : side ? 0 : wide / 2), x.end - wide - 2)), base = py + up;
        const box = {left, right: left + wide, top: base - 11, base, low: base + 3, px};
        const over = ([u, v], spare) => u > box.left - spare && u < box.right + spare && v > box.top - spare && v < box.low + spare;
        const near = placed.filter((o) => (o.left < box.right + 3 && box.left < o.right + 3) || Math.abs(o.px - px) < 40);
        const hit = near.filter((o) => o.left < box.right + 3 && box.left < o.right + 3 && Math.abs(base - o.base) < 13).length, above = near.filter((o) => peak && base <= o.base).length;
        const out = box.top < y.end || box.low > y.start;
        const cost = away + 5000 * out + 500 * hit + 60 * above + 120 * marks.filter((at) => over(at, 5)).length + 3 * curves.filter((at) => over(at, 1)).length;
        if (cost < best.cost) best = {cost, box};
      }
      placed.push(best.box);
      for (const [key, value] of [["x", best.box.left], ["y", best.box.base]]) text.setAttribute(key, value.toFixed(1));
    }
  }

  axes(x, y, width, height) {
    const powers = [x, y].map((s) => exponent(Math.max(Math.abs(s.low), Math.abs(s.high))));
    const grid = svg("g", {class: "grid"}, this.svg);
    const say = (value, power, step) => (value / 10 ** power + 0).toFixed(Math.max(0, Math.min(9, -Math.floor(Math.log10(step / 10 ** power) + 1e-9)))).replace("-", "−");
    const across = ticks(x.low, x.high, Math.max(2, Math.floor((x.end - x.start) / (this.panelled ? 45 : 70))), this.figure.x.unit === "deg");
    for (const v of across.values) {
      svg("path", {d: `M${x(v)} ${y.start}V${y.end}`}, grid);
      svg("text", {x: x(v), y: y.start + 17, "text-anchor": "middle"}, this.svg, say(v, powers[0], across.step));
    }
    const up = ticks(y.low, y.high, Math.max(2, Math.floor((y.start - y.end) / (this.panelled ? 22 : 45))), this.figure.y.unit === "deg");
    for (const v of up.values) {
      svg("path", {d: `M${x.start} ${y(v)}H${x.end}`}, grid);
      svg("text", {x: x.start - 7, y: y(v) + 4, "text-anchor": "end"}, this.svg, say(v, powers[1], up.step));
    }
    svg("path", {d: `M${x.start} ${y.end}V${y.start}H${x.end}`, class: "axis"}, this.svg);
    if (this.panelled) return void (powers[1] && svg("text", {x: x.start + 4, y: 11, class: "title"}, this.svg, `×10${superscript(powers[1])}`));
    const title = (axis, power) => [axis.label, ...(power || axis.unit ? [`(${power ? `10${superscript(power)} ` : ""}${axis.unit})`] : [])].join(" ");
    svg("text", {x: (x.start + x.end) / 2, y: height - 8, "text-anchor": "middle", class: "title"}, this.svg, title(this.figure.x, powers[0]));
    const middle = (y.start + y.end) / 2, aside = width < 480 ? 10 : 13;
    svg("text", {x: aside, y: middle, "text-anchor": "middle", transform: `rotate(-90 ${aside} ${middle})`, class: "title"}, this.svg, title(this.figure.y, powers[1]));
  }

  drawSeries(s, parent, x, y) {
    const group = svg("g", {class: `series ${s.mark}`, style: `--colour: var(--${s.role}, var(--analytic))`}, parent);
    if (["marker", "joint", "pivot"].includes(s.mark)) {
      const glyph = {joint: "circle", pivot: "pivot"}[s.mark] ?? SHAPES[s.role] ?? "circle";
      const r = {joint: 5, pivot: 11}[s.mark] ?? (SIZES[glyph] ?? 4.5) * (this.panelled ? 0.6 : 1) + 1.5 * s.level;
      const points = s.x.map((a, i) => (known(a) && known(s.y[i]) ? `M${x(a).toFixed(2)} ${y(s.y[i]).toFixed(2)}${GLYPHS[glyph](r)}` : ""));
      svg("path", {d: points.join("")}, group);
      return;
    }
    let pen = "M", d = "";
    s.x.forEach((a, i) => {
      const both = known(a) && known(s.y[i]);
      if (both) d += `${pen}${x(a).toFixed(2)} ${y(s.y[i]).toFixed(2)}`;
      pen = both ? "L" : "M";
    });
    const line = svg("path", {d}, group);
    if (!["dashed", "band"].includes(s.mark) && DASHES[s.level % 4]) line.setAttribute("stroke-dasharray", DASHES[s.level % 4]);
  }

  // ------------------------------------------------------------------ reading and zooming

  listen() {
    const position = (event) => {
      const box = this.svg.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.svg.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse" && event.button === 0) {
        this.from = position(event);
        this.svg.setPointerCapture(event.pointerId);
      }
    });
    this.svg.addEventListener("pointermove", (event) => {
      const at = position(event);
      this.read(at[0], at[1]);
      if (this.from) this.box(this.from, at);
    });
    this.svg.addEventListener("pointerup", (event) => {
      const from = this.from, at = position(event);
      this.from = null;
      if (from && Math.abs(at[0] - from[0]) > 8) this.zoomTo(from, at);
    });
    this.svg.addEventListener("pointerleave", () => this.from || this.unread());
    this.svg.addEventListener("blur", () => this.unread());
    this.svg.addEventListener("dblclick", () => this.reset());
    this.svg.addEventListener("keydown", (event) => this.key(event));
  }

  box(from, at) {
    const flat = this.figure.kind === "curves" && Math.abs(at[1] - from[1]) < 15;
    const {y} = this.scales;
    const [top, bottom] = flat ? [y.end, y.start] : [Math.min(from[1], at[1]), Math.max(from[1], at[1])];
    svg("rect", {x: Math.min(from[0], at[0]), y: top, width: Math.abs(at[0] - from[0]), height: bottom - top, class: "box"}, this.over);
  }

  zoomTo(from, at) {
    const {x, y} = this.scales, sorted = (a, b) => [Math.min(a, b), Math.max(a, b)];
    const flat = this.figure.kind === "curves" && Math.abs(at[1] - from[1]) < 15;
    this.zoomed = {x: sorted(x.back(from[0]), x.back(at[0])), y: flat ? (this.zoomed?.y ?? null) : sorted(y.back(from[1]), y.back(at[1]))};
    this.draw();
  }

  key(event) {
    const samples = [...new Set(this.shown().filter((s) => s.name).flatMap((s) => s.x.filter(known)))].sort((a, b) => a - b);
    const step = {ArrowRight: 1, ArrowLeft: -1, Home: -Infinity, End: Infinity}[event.key];
    if (step !== undefined && this.figure.kind === "curves" && samples.length) {
      const here = this.cursor === null ? -1 : samples.findIndex((v) => v >= this.cursor - 1e-9);
      const next = samples[Math.min(Math.max(here + step, 0), samples.length - 1)];
      this.read(this.scales.x(next), null);
    } else if (event.key === "+" || event.key === "=") this.zoom(0.6);
    else if (event.key === "-") this.zoom(1 / 0.6);
    else if (event.key === "0" || event.key === "Escape") this.reset();
    else return;
    event.preventDefault();
  }

  read(px, py) {
    const {x, y} = this.scales;
    const rows = this.figure.kind === "curves" ? this.readCurves(x.back(px)) : this.readPlane(px, py);
    this.over.replaceChildren();
    if (!rows) return this.unread();
    this.cursor = rows.x;
    if (this.figure.kind === "curves") svg("path", {d: `M${x(rows.x)} ${y.start}V${y.end}`, class: "cursor"}, this.over);
    for (const p of rows.points) svg("circle", {cx: x(p.x), cy: y(p.y), r: 4, class: "dot", style: `--colour: var(--${p.role}, var(--analytic))`}, this.over);
    this.tip.replaceChildren();
    html("strong", {}, this.tip, rows.title);
    for (const p of rows.points) {
      const line = html("span", {style: `--colour: var(--${p.role}, var(--analytic))`}, this.tip);
      html("i", {}, line);
      line.append(`${p.name} `);
      html("b", {}, line, p.text);
    }
    this.tip.hidden = false;
    const beyond = x(rows.x) + this.tip.offsetWidth + 24 > this.scales.width;
    this.tip.style.left = `${Math.max(4, beyond ? x(rows.x) - this.tip.offsetWidth - 12 : x(rows.x) + 12)}px`;
    this.tip.style.top = `${Math.max(4, (py ?? 60) - this.tip.offsetHeight - 10)}px`;
    if (py === null) this.live.textContent = `${rows.title}: ${rows.points.map((p) => `${p.name} ${p.text}`).join(", ")}`;
  }

  unread() {
    this.cursor = null;
    this.tip.hidden = true;
    this.over?.replaceChildren();
  }

  readCurves(at) {
    const series = this.shown().filter((s) => s.name);
    const nearest = series.flatMap((s) => s.x.filter(known)).reduce((best, v) => (best === null || Math.abs(v - at) < Math.abs(best - at) ? v : best), null);
    if (nearest === null) return null;
    const there = series.map((s) => [s, s.x.indexOf(nearest), s.x.lastIndexOf(nearest)]).filter(([s, i]) => i >= 0 && known(s.y[i]));
    const digits = apart(there.map(([s, i]) => s.y[i]));
    const points = there.map(([s, i, end]) => {
      const low = s.mark === "band" && end > i ? `${number(s.y[end])} to ` : "";
      return {x: nearest, y: s.y[i], role: s.role, name: s.name, text: `${low}${number(s.y[i], digits)} ${this.figure.y.unit}`};
    });
    return {x: nearest, title: `${this.figure.x.label} ${number(nearest)} ${this.figure.x.unit}`, points};
  }

  readPlane(px, py) {
    const {x, y} = this.scales;
    let best = null;
    for (const s of this.shown()) {
      if (!s.name || py === null) continue;
      s.x.forEach((a, i) => {
        if (!known(a) || !known(s.y[i])) return;
        const away = Math.hypot(x(a) - px, y(s.y[i]) - py);
        if (away < (best?.away ?? 30)) best = {away, x: a, y: s.y[i], role: s.role, name: s.name};
      });
    }
    if (!best) return null;
    return {x: best.x, title: best.name, points: [{...best, name: "at", text: `${number(best.x)}, ${number(best.y)} ${this.figure.y.unit}`}]};
  }
}

// The charts of a page: each figure in its place or its panels in theirs, with its files and its data as a table.
function figuresOf(page, figures) {
  for (const button of page.querySelectorAll("[data-download]")) button.addEventListener("click", () => download(button, figures[Number(button.dataset.of)]));
  return [...page.querySelectorAll("[data-figure]")].map((place) => {
    const figure = figures[Number(place.dataset.figure)], details = place.closest("figure")?.querySelector("details");
    details?.addEventListener("toggle", () => details.open && !details.querySelector("table") && tabulate(details, figure));
    return new Chart(place, figure, "panel" in place.dataset ? {panel: Number(place.dataset.panel)} : {});
  });
}

// A figure as a file: its drawing as on paper (SVG, or twice as large in pixels), or all of its points, a row for each.
function download(button, figure) {
  const drawing = document.getElementById(`drawing-${button.dataset.of}`).textContent.trim(), kind = button.dataset.download;
  if (kind === "png") return pixels(drawing, (url) => save(url, button.dataset.name));
  const url = URL.createObjectURL(new Blob([kind === "svg" ? drawing : points(figure)], {type: kind === "svg" ? "image/svg+xml" : "text/csv"}));
  save(url, button.dataset.name);
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

function save(url, name) {
  const link = html("a", {href: url, download: name}, document.body);
  link.click();
  link.remove();
}

function pixels(drawing, done) {
  const image = new Image();
  image.addEventListener("load", () => {
    const canvas = html("canvas", {width: 2 * image.width, height: 2 * image.height}, null);
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    done(canvas.toDataURL("image/png"));
  });
  image.src = `data:image/svg+xml,${encodeURIComponent(drawing)}`;
}

function points(figure) {
  const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
  const head = ["series", `${figure.x.label} [${figure.x.unit}]`, `${figure.y.label} [${figure.y.unit}]`].map(quoted);
  const rows = figure.series.filter((s) => s.name).flatMap((s) => s.x.map((x, i) => [quoted(s.name), x ?? "", s.y[i] ?? ""]));
  return [head, ...rows].map((row) => row.join(",")).join("\n") + "\n";
}

// The figure's data as a table, made when somebody opens it.
function tabulate(details, figure) {
  const series = figure.series.filter((s) => s.name && s.mark !== "link");
  const table = html("table", {}, html("div", {class: "scroll", tabindex: "0", role: "region", "aria-label": `Data: ${figure.title}`}, details));
  const head = html("tr", {}, html("thead", {}, table)), body = html("tbody", {}, table);
  const cell = (row, value) => html("td", {}, row, number(value, 6));
  if (figure.kind === "curves") {
    html("th", {scope: "col"}, head, [figure.x.label, figure.x.unit && `(${figure.x.unit})`].join(" "));
    for (const s of series) html("th", {scope: "col"}, head, `${s.name} (${figure.y.unit})`);
    for (const x of [...new Set(series.flatMap((s) => s.x))].filter(known).sort((a, b) => a - b)) {
      const row = html("tr", {}, body);
      html("th", {scope: "row"}, row, number(x, 6));
      for (const s of series) cell(row, s.x.includes(x) ? s.y[s.x.indexOf(x)] : null);
    }
    return;
  }
  for (const name of ["series", `x (${figure.x.unit})`, `y (${figure.y.unit})`]) html("th", {scope: "col"}, head, name);
  for (const s of series.filter((s) => s.role !== "frame")) {
    const every = Math.ceil(s.x.length / 100);
    s.x.forEach((x, i) => {
      if (i % every || !known(x)) return;
      const row = html("tr", {}, body);
      html("th", {scope: "row"}, row, s.name);
      cell(row, x);
      cell(row, s.y[i]);
    });
  }
}
