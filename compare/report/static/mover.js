// The linkage in motion: it plays, one run of several at a time, each side of it laid over the linkage without clearance,
// with the paths of its pins, its reactions as arrows, its gaps enlarged and where each pin lies in its own.
"use strict";

const SECONDS = 4; // of one way through the motion as it opens
const ARROW = 0.25; // of the linkage's height, or of 0.6 of its width: the largest reaction

class Mover {
  constructor(root, data, onMove) {
    Object.assign(this, {root, data, onMove, linkage: new Linkage(data.parts), playing: false, rims: []});
    this.find = (name) => root.querySelector(`[data-${name}]`);
    this.slider = this.find("slider");
    this.factor = this.find("factor");
    this.chosen = this.find("run");
    this.run = data.runs[Number(this.chosen?.value ?? 0)];
    this.sample = this.run.opens;
    this.chart = new Chart(this.find("linkage"), this.figure([]), {tallest: 400});
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    this.find("play").addEventListener("click", () => this.play(!this.playing));
    for (const box of root.querySelectorAll("[data-show]")) box.addEventListener("change", () => this.draw());
    this.chosen?.addEventListener("change", () => this.choose());
    this.factor?.addEventListener("input", () => {
      this.magnify(Number((10 ** Number(this.factor.value)).toPrecision(2)));
      this.draw();
    });
    new ResizeObserver(() => this.spreadRims()).observe(this.find("rims"));
    this.choose();
  }

  // Take up the chosen run, at the place that the last one was at.
  choose() {
    const before = this.run, at = before.x[this.sample];
    this.run = this.data.runs[Number(this.chosen?.value ?? 0)];
    const {x, unit, label, opens, ideal, clearance, factor} = this.run, away = (v) => Math.abs(v - at);
    this.sample = before === this.run ? this.sample : before.unit === unit ? x.reduce((best, v, i) => (away(v) < away(x[best]) ? i : best), 0) : opens;
    Object.assign(this.slider, {min: 0, max: x.length - 1, step: 1, value: this.sample});
    this.find("abscissa").textContent = label;
    const adjustable = Boolean(ideal) && Object.keys(clearance).length > 0;
    this.magnify(adjustable ? factor : 1);
    if (this.factor) Object.assign(this.factor, {disabled: !adjustable, value: Math.log10(this.times)});
    this.listRims();
    this.listReadout();
    this.draw();
  }

  magnify(times) {
    this.times = times;
    const poses = this.run.x.flatMap((_, i) => [this.linkage.pose(this.run.ideal, i), ...this.run.sides.map((side) => this.pose(side, i))]);
    const frame = this.linkage.frame(poses);
    this.height = Math.max(frame.y[1] - frame.y[0], 0.6 * (frame.x[1] - frame.x[0]));
    const arrows = this.run.x.flatMap((_, i) => this.arrows(this.pose(this.run.sides[0], i), i)), around = (axis) => extent([...frame[axis], ...arrows.flatMap((a) => a[axis])], 0);
    this.chart.options.range = {x: around("x"), y: around("y")};
    this.paths = this.pinPaths();
  }

  figure(series) {
    const {label, unit, x} = this.run;
    const summary = this.times > 1 ? `Gaps drawn ${this.times} times as large.` : "";
    return {name: "mover", title: `The linkage at ${label} ${number(x[this.sample])} ${unit}`, summary, kind: "plane", x: {label: "x", unit: "mm"}, y: {label: "y", unit: "mm"}, series};
  }

  // What has no box to tick is shown.
  shows(which) {
    return this.root.querySelector(`[data-show="${which}"]`)?.checked ?? true;
  }

  pose(side, i) {
    return this.linkage.magnified(this.linkage.pose(side.poses, i), this.linkage.pose(this.run.ideal, i), this.times);
  }

  // Where each pin that moves goes on the first side, over all samples.
  pinPaths() {
    const moving = this.data.parts.joints.filter((j) => !j.bodies.includes("ground") || j.axis);
    return moving.map((joint) => {
      const points = this.run.x.map((_, i) => {
        const pose = this.pose(this.run.sides[0], i);
        return pose && this.linkage.point(pose, joint.bodies[1] === "ground" ? joint.bodies[0] : joint.bodies[1], joint.name);
      });
      if (this.run.round) points.push(points[0]);
      return {name: "", x: points.map((p) => p && 1e3 * p[0]), y: points.map((p) => p && 1e3 * p[1]), role: "frame", mark: "line", level: 0, scale: true, labels: []};
    });
  }

  // ------------------------------------------------------------------ playing

  play(on) {
    this.playing = on;
    const button = this.find("play");
    button.textContent = on ? "❚❚ Pause" : "▶ Play";
    button.setAttribute("aria-pressed", String(on));
    if (!on) return;
    this.begun = null;
    requestAnimationFrame((now) => this.step(now));
  }

  step(now) {
    if (!this.playing) return;
    const count = this.run.x.length, way = this.run.round ? count : Math.max(2 * (count - 1), 1);
    this.begun ??= {now, place: this.sample};
    const pace = Number(this.find("pace").value) * count / SECONDS / 1000; // samples in a ms
    const place = Math.floor(this.begun.place + (now - this.begun.now) * pace) % way;
    const next = place < count ? place : way - place;
    if (next !== this.sample) this.go(next, true);
    requestAnimationFrame((later) => this.step(later));
  }

  go(sample, playing = false) {
    if (!playing && this.playing) this.play(false);
    this.sample = sample;
    this.slider.value = sample;
    this.draw();
  }

  // ------------------------------------------------------------------ drawing

  draw() {
    const i = this.sample, {x, unit, label, flags, clearance, sides, columns, readout} = this.run, series = [];
    if (this.shows("paths")) series.push(...this.paths);
    const ideal = this.linkage.pose(this.run.ideal, i), loose = Object.keys(clearance).length > 0;
    if (loose && ideal && this.shows("ideal")) series.push(...this.linkage.drawn(ideal, "without clearance", "ideal-line", {}));
    const gaps = Object.fromEntries(Object.entries(clearance).map(([joint, c]) => [joint, c * this.times]));
    const posed = sides.filter((side) => this.shows(side.which)).map((side) => ({...side, pose: this.pose(side, i)})).filter((side) => side.pose);
    for (const {pose, name, role} of posed) series.push(...this.linkage.drawn(pose, name, role, gaps));
    if (posed.length && this.shows("forces")) series.push(...this.arrows(posed[0].pose, i));
    this.chart.update(this.figure(series));
    const said = `${number(x[i])} ${unit}`;
    this.find("value").textContent = said;
    this.slider.setAttribute("aria-valuetext", said);
    if (this.factor) this.find("magnified").textContent = `× ${this.times}`;
    this.factor?.setAttribute("aria-valuetext", `${this.times} times`);
    const flag = flags[i] ? `The model has no answer here: ${flags[i]}.` : "";
    this.find("flag").textContent = flag;
    this.drawRims(i);
    const cells = readout.map((r) => r.values.map((values, c) => number(values[i], columns[c].digits)));
    cells.forEach((row, k) => row.forEach((text, c) => (this.cells[k][c].textContent = text)));
    const told = readout.slice(0, 4).map((r, k) => `${r.label}: ${columns.slice(0, 2).map((column, c) => `${column.says} ${cells[k][c]}`.trim()).join(", ")} ${r.unit}`);
    if (!this.playing) this.find("live").textContent = `${label} ${said}. ${flag} ${told.join("; ")}.`;
    this.onMove(x[i], unit);
  }

  // Reactions and loads.
  arrows(pose, i) {
    return pose ? [...this.data.parts.joints.flatMap((joint) => this.arrow(joint, pose, i)), ...this.run.loads.flatMap((load) => this.pushed(load, pose, i))] : [];
  }

  // The force on a joint's second body, from the joint on; a slide's from its block.
  arrow(joint, pose, i) {
    const force = this.run.forces[joint.name];
    const body = joint.axis && joint.bodies[1] !== "ground" ? joint.bodies[1] : joint.bodies[0];
    return force ? this.arrowFrom(this.linkage.point(pose, body, joint.name), force, force.role, i) : [];
  }

  // A load, to where it acts.
  pushed(load, pose, i) {
    const {x, y, angle} = pose[load.body], [u, v] = load.point;
    const at = [x + u * Math.cos(angle) - v * Math.sin(angle), y + u * Math.sin(angle) + v * Math.cos(angle)];
    return load.turn ? this.turned(at, load.turn[i]) : this.arrowFrom(at, load, "bad", i, true);
  }

  // A torque, round a point: three quarters of a circle where it is the largest.
  turned(at, share) {
    if (!known(share) || Math.abs(share) < 0.01) return [];
    const radius = 0.07 * this.height, whole = 1.5 * Math.PI * share, head = Math.sign(share) * Math.min(0.5, Math.abs(whole) / 2);
    const on = (turn, r = radius) => at.map((v, k) => 1e3 * v + r * (k ? Math.sin(turn) : Math.cos(turn)));
    const points = Array.from({length: 25}, (_, k) => on((whole * k) / 24));
    points.push(on(whole - head, 1.25 * radius), on(whole), on(whole - head, 0.75 * radius));
    return [{name: "", x: points.map((p) => p[0]), y: points.map((p) => p[1]), role: "bad", mark: "line", level: 0, scale: true, labels: []}];
  }

  arrowFrom(at, force, role, i, ends = false) {
    if (!known(force.x[i]) || !known(force.y[i])) return [];
    const per = (ARROW * this.height) / this.run.largest, whole = per * Math.hypot(force.x[i], force.y[i]);
    const shorter = Math.min(1, (1.5 * ARROW * this.height) / whole), [fx, fy] = [shorter * per * force.x[i], shorter * per * force.y[i]], size = Math.hypot(fx, fy);
    if (!(size >= 0.01 * this.height)) return [];
    const [x, y] = at.map((v) => 1e3 * v), start = ends ? [x - fx, y - fy] : [x, y], tip = [start[0] + fx, start[1] + fy];
    const [ux, uy] = [fx / size, fy / size], head = Math.min(0.035 * this.height, size / 2);
    const side = (s) => [tip[0] - head * (ux + s * 0.45 * uy), tip[1] - head * (uy - s * 0.45 * ux)];
    const points = [start, tip, side(1), tip, side(-1)];
    return [{name: "", x: points.map((p) => p[0]), y: points.map((p) => p[1]), role, mark: "line", level: 0, scale: true, labels: []}];
  }

  // ------------------------------------------------------------------ clearance circles and values

  listRims() {
    const place = this.find("rims");
    place.replaceChildren();
    this.rims = Object.entries(this.run.clearance).filter(([joint]) => this.run.gaps[joint]).map(([joint, radius]) => {
      const box = html("figure", {class: "rim", id: `rim-${joint}`}, place);
      html("figcaption", {}, box, `${joint}: gap ${number(1e3 * radius)} mm`);
      const reach = this.run.gaps[joint].flatMap(([x, y]) => x.map((v, i) => (known(v) && known(y[i]) ? Math.hypot(v, y[i]) / (1e3 * radius) : 0)));
      const half = Math.max(1.3, reach.reduce((a, b) => Math.max(a, b), 0) + 0.2); // a soft contact lets its journal out of the circle
      const drawing = svg("svg", {viewBox: `${-half} ${-half} ${2 * half} ${2 * half}`, role: "img"}, box);
      return {joint, radius, drawing};
    });
    this.spreadRims();
  }

  // As many circles in each row.
  spreadRims() {
    const place = this.find("rims"), rows = Math.ceil((this.rims.length * 92) / Math.max(place.clientWidth, 92));
    place.style.gridTemplateColumns = `repeat(${Math.ceil(this.rims.length / rows) || 1}, minmax(0, 8rem))`;
  }

  drawRims(i) {
    for (const {joint, radius, drawing} of this.rims) {
      drawing.replaceChildren();
      svg("circle", {r: 1, class: "circle"}, drawing);
      svg("path", {d: "M-1.2 0H1.2M0 -1.2V1.2", class: "hair"}, drawing);
      const said = [];
      this.run.sides.forEach(({which, role}, k) => {
        const [x, y] = this.run.gaps[joint][k].map((values) => values[i]);
        if (!known(x) || !known(y)) return;
        const [px, py] = [x / (1e3 * radius), -y / (1e3 * radius)], style = `--colour: var(--${role}, var(--analytic))`;
        svg("path", {d: `M0 0L${px} ${py}`, class: `arm ${which}`, style}, drawing);
        svg("circle", {cx: px, cy: py, r: which === "analytic" ? 0.07 : 0.12, class: `journal ${which}`, style}, drawing);
        said.push(`${which} ${number(x)}, ${number(y)} mm`);
      });
      drawing.setAttribute("aria-label", `Displacement of the journal of ${joint}: ${said.join("; ") || "not known"}`);
    }
  }

  listReadout() {
    const body = this.find("readout");
    body.replaceChildren();
    this.cells = this.run.readout.map((r) => {
      const row = html("tr", {}, body);
      html("th", {scope: "row"}, row, `${r.label} (${r.unit})`);
      return r.values.map(() => html("td", {class: "number"}, row));
    });
  }
}

// ---------------------------------------------------------------------- the page

document.documentElement.classList.add("ready");
const data = JSON.parse(document.getElementById("data").textContent);
const charts = figuresOf(document, data.figures);
const root = document.getElementById("mover"), close = document.querySelector("[data-close]");
if (root) new Mover(root, data.motion, (x, unit) => charts.forEach((c) => c.figure.x.unit === unit && c.mark(x)));
close?.addEventListener("change", () => charts.filter((c) => c.panelled).forEach((c) => {
  c.options.close = close.checked;
  c.reset();
}));
