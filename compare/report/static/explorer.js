// The linkage that moves with the slider: ideal, analytic and simulated configuration of one run, laid over each other.
"use strict";

class Explorer {
  constructor(root, data, onMove) {
    Object.assign(this, {root, data, onMove, linkage: new Linkage(data.parts)});
    this.find = (name) => root.querySelector(`[data-${name}]`);
    this.slider = this.find("slider");
    this.factor = this.find("factor");
    this.model = this.find("model");
    const mm = {label: "x", unit: "mm"};
    this.chart = new Chart(this.find("linkage"), this.figure("The linkage", [], mm), {tallest: 400});
    this.rims = [];
    this.model.addEventListener("change", () => this.choose());
    this.slider.addEventListener("input", () => this.move());
    this.factor.addEventListener("input", () => this.move(true));
    for (const box of root.querySelectorAll("[data-show]")) box.addEventListener("change", () => this.move());
    this.choose();
  }

  figure(title, series, axis = {label: "x", unit: "mm"}) {
    return {name: "explorer", title, summary: "", kind: "plane", x: axis, y: {label: "y", unit: "mm"}, series};
  }

  // ------------------------------------------------------------------ state

  choose() {
    const before = this.run?.unit === this.data.runs[this.model.value].unit ? Number(this.slider.value) : null;
    this.run = this.data.runs[this.model.value];
    const {x, unit} = this.run;
    const steps = x.slice(1).map((v, i) => Math.abs(v - x[i]));
    const even = steps.every((s) => Math.abs(s - steps[0]) < 1e-6 * Math.abs(steps[0]));
    Object.assign(this.slider, {min: Math.min(...x), max: Math.max(...x), step: even && steps.length ? String(Number(steps[0].toPrecision(6))) : "any"});
    this.slider.value = before ?? x[this.run.opens];
    this.find("abscissa").textContent = `${this.run.label} (${unit})`;
    const adjustable = this.run.ideal && Object.keys(this.run.clearance).length > 0;
    this.factor.disabled = !adjustable;
    this.factor.value = Math.log10(adjustable ? this.run.factor : 1);
    this.magnify = adjustable ? this.run.factor : 1;
    this.listReadout();
    this.listRims();
    this.move();
  }

  index() {
    const at = Number(this.slider.value);
    return this.run.x.reduce((best, v, i) => (Math.abs(v - at) < Math.abs(this.run.x[best] - at) ? i : best), 0);
  }

  move(magnified = false) {
    if (magnified) this.magnify = Number((10 ** Number(this.factor.value)).toPrecision(2));
    const i = this.index(), {x, unit, label, flags} = this.run;
    const text = `${number(x[i])} ${unit}`;
    this.slider.setAttribute("aria-valuetext", text);
    this.find("value").textContent = text;
    this.factor.setAttribute("aria-valuetext", `${this.magnify} times`);
    this.find("magnified").textContent = `× ${this.magnify}`;
    this.drawLinkage(i);
    this.drawRims(i);
    this.read(i);
    const flag = flags[i] ? ` Flagged: ${flags[i]}.` : "";
    this.find("flag").textContent = flag;
    const said = this.run.readout.slice(0, 4).map((r) => `${r.label}: analytic ${number(r.analytic[i])}, simulated ${number(r.simulated[i])} ${r.unit}`);
    this.find("live").textContent = `${label} ${text}.${flag} ${said.join("; ")}.`;
    this.onMove(x[i], unit);
  }

  // ------------------------------------------------------------------ the linkage

  pose(which, i) {
    return this.linkage.pose(this.run[which], i);
  }

  magnified(pose, ideal) {
    return this.linkage.magnified(pose, ideal, this.magnify);
  }

  drawLinkage(i) {
    const {clearance, analytic_model, title, role} = this.run;
    const wanted = (which) => this.root.querySelector(`[data-show="${which}"]`).checked;
    const ideal = this.pose("ideal", i), gaps = Object.fromEntries(Object.entries(clearance).map(([j, c]) => [j, c * this.magnify]));
    const series = [];
    const sets = [["ideal", ideal, "ideal linkage", "ideal-line", {}], ["analytic", this.magnified(this.pose("analytic", i), ideal), Object.keys(clearance).length ? `analytic, ${analytic_model}` : "analytic", "analytic", gaps], ["simulated", this.magnified(this.pose("simulated", i), ideal), title, role, gaps]];
    for (const [which, pose, name, colour, rims] of sets) if (pose && wanted(which)) series.push(...this.linkage.drawn(pose, name, colour, rims));
    this.chart.options.range = this.range();
    const at = `${this.run.label} ${number(this.run.x[i])} ${this.run.unit}`;
    this.chart.update({...this.figure(`The linkage at ${at}`, series), summary: `Gaps drawn ${this.magnify} times as large.`});
  }

  range() {
    if (this.framed?.run === this.run && this.framed.magnify === this.magnify) return this.framed;
    const poses = this.run.x.flatMap((_, i) => {
      const ideal = this.pose("ideal", i);
      return [ideal, this.magnified(this.pose("analytic", i), ideal), this.magnified(this.pose("simulated", i), ideal)];
    });
    this.framed = {run: this.run, magnify: this.magnify, ...this.linkage.frame(poses)};
    return this.framed;
  }

  // ------------------------------------------------------------------ clearance circles and values

  listRims() {
    const place = this.find("rims");
    place.replaceChildren();
    this.rims = Object.entries(this.run.clearance).map(([joint, radius]) => {
      const box = html("figure", {class: "rim", id: `rim-${joint}`}, place);
      html("figcaption", {}, box, `Journal of ${joint} in its clearance, ${number(1e3 * radius)} mm`);
      const sides = Object.values(this.run.gaps[joint]);
      const reach = sides.flatMap(([x, y]) => x.map((v, i) => (known(v) && known(y[i]) ? Math.hypot(v, y[i]) / (1e3 * radius) : 0)));
      const half = Math.max(1.3, reach.reduce((a, b) => Math.max(a, b), 0) + 0.2); // a soft contact lets its journal out of the circle
      const drawing = svg("svg", {viewBox: `${-half} ${-half} ${2 * half} ${2 * half}`, role: "img"}, box);
      return {joint, radius, drawing};
    });
  }

  drawRims(i) {
    for (const {joint, radius, drawing} of this.rims) {
      drawing.replaceChildren();
      svg("circle", {r: 1, class: "circle"}, drawing);
      svg("path", {d: "M-1.2 0H1.2M0 -1.2V1.2", class: "hair"}, drawing);
      const said = [];
      for (const [which, role] of [["analytic", "analytic"], ["simulated", this.run.role]]) {
        const [x, y] = this.run.gaps[joint][which].map((values) => values[i]);
        if (!known(x) || !known(y)) continue;
        const [px, py] = [x / (1e3 * radius), -y / (1e3 * radius)], style = `--colour: var(--${role}, var(--analytic))`;
        svg("path", {d: `M0 0L${px} ${py}`, class: `arm ${which}`, style}, drawing);
        svg("circle", {cx: px, cy: py, r: which === "analytic" ? 0.07 : 0.12, class: `journal ${which}`, style}, drawing);
        said.push(`${which} ${number(x)}, ${number(y)} mm`);
      }
      drawing.setAttribute("aria-label", `Displacement of the journal of ${joint}: ${said.join("; ") || "not known"}`);
    }
  }

  listReadout() {
    const body = this.find("readout");
    body.replaceChildren();
    this.cells = this.run.readout.map((r) => {
      const row = html("tr", {}, body);
      html("th", {scope: "row"}, row, `${r.label} (${r.unit})`);
      return [0, 1, 2].map(() => html("td", {}, row));
    });
  }

  read(i) {
    this.run.readout.forEach((r, k) => [r.analytic[i], r.simulated[i], r.difference[i]].forEach((v, c) => (this.cells[k][c].textContent = number(v, c === 2 ? 3 : 5))));
  }
}

// ---------------------------------------------------------------------- the page

const data = JSON.parse(document.getElementById("data").textContent);
const charts = figuresOf(document, data.figures);
const root = document.getElementById("explorer");
if (root) new Explorer(root, data.explorer, (x, unit) => charts.forEach((c) => c.figure.x.unit === unit && c.mark(x)));
document.documentElement.classList.add("ready");
