// The linkage by itself: it plays, with the paths of its pins, its reactions as arrows and its gaps enlarged.
"use strict";

const SECONDS = 4; // of one way through the motion as it opens
const ARROW = 0.25; // of the drawing's height: the largest reaction
const ROOM = 0.2; // of the linkage's size, around it for arrows

class Mover {
  constructor(root, data, onMove) {
    Object.assign(this, {root, data, onMove, linkage: new Linkage(data.parts), sample: data.opens, playing: false});
    this.find = (name) => root.querySelector(`[data-${name}]`);
    this.slider = this.find("slider");
    Object.assign(this.slider, {min: 0, max: data.x.length - 1, step: 1, value: data.opens});
    this.times = data.factor;
    this.paths = this.pinPaths();
    this.chart = new Chart(this.find("linkage"), this.figure([]), {tallest: 400, range: this.frame()});
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    this.find("play").addEventListener("click", () => this.play(!this.playing));
    for (const box of root.querySelectorAll("[data-show]")) box.addEventListener("change", () => this.draw());
    const factor = this.find("factor");
    if (factor) {
      factor.value = Math.log10(this.times);
      factor.addEventListener("input", () => {
        this.times = Number((10 ** Number(factor.value)).toPrecision(2));
        this.chart.options.range = this.frame();
        this.paths = this.pinPaths();
        this.draw();
      });
    }
    this.listReadout();
    this.draw();
  }

  figure(series) {
    const {label, unit, x} = this.data, at = `${label} ${number(x[this.sample])} ${unit}`;
    return {name: "mover", title: `The linkage at ${at}`, summary: "", kind: "plane", x: {label: "x", unit: "mm"}, y: {label: "y", unit: "mm"}, series};
  }

  shows(which) {
    return this.root.querySelector(`[data-show="${which}"]`)?.checked ?? false;
  }

  pose(i) {
    return this.linkage.magnified(this.linkage.pose(this.data.displaced, i), this.linkage.pose(this.data.ideal, i), this.times);
  }

  frame() {
    const frame = this.linkage.frame(this.data.x.flatMap((_, i) => [this.linkage.pose(this.data.ideal, i), this.pose(i)]), ROOM);
    this.height = frame.y[1] - frame.y[0];
    return frame;
  }

  // Where each pin that moves goes, over all samples.
  pinPaths() {
    const moving = this.data.parts.joints.filter((j) => !j.bodies.includes("ground") || j.axis);
    return moving.map((joint) => {
      const points = this.data.x.map((_, i) => {
        const pose = this.pose(i);
        return pose && this.linkage.point(pose, joint.bodies[1] === "ground" ? joint.bodies[0] : joint.bodies[1], joint.name);
      });
      if (this.data.round) points.push(points[0]);
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
    const count = this.data.x.length, way = this.data.round ? count : Math.max(2 * (count - 1), 1);
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
    const i = this.sample, {x, unit, flags, clearance, parts} = this.data, pose = this.pose(i), series = [];
    if (this.shows("paths")) series.push(...this.paths);
    const ideal = this.linkage.pose(this.data.ideal, i), loose = Object.keys(clearance).length > 0;
    if (loose && ideal && this.shows("ideal")) series.push(...this.linkage.drawn(ideal, "without clearance", "ideal-line", {}));
    if (pose) {
      const gaps = Object.fromEntries(Object.entries(clearance).map(([joint, c]) => [joint, c * this.times]));
      series.push(...this.linkage.drawn(pose, loose ? "with clearance" : "", "analytic", gaps, true));
      if (this.shows("forces")) series.push(...parts.joints.flatMap((joint) => this.arrow(joint, pose, i)), ...this.data.loads.flatMap((load) => this.pushed(load, pose, i)));
    }
    this.chart.update(this.figure(series));
    const said = `${number(x[i])} ${unit}`;
    this.find("value").textContent = said;
    this.slider.setAttribute("aria-valuetext", said);
    const times = this.find("magnified");
    if (times) times.textContent = `× ${this.times}`;
    this.find("flag").textContent = flags[i] ? `No answer here: ${flags[i]}.` : "";
    this.data.readout.forEach((r, k) => (this.cells[k].textContent = number(r.values[i], 4)));
    this.onMove(x[i], unit);
  }

  // The force on a joint's second body, from the joint on; a slide's from its block.
  arrow(joint, pose, i) {
    const force = this.data.forces[joint.name];
    const body = joint.axis && joint.bodies[1] !== "ground" ? joint.bodies[1] : joint.bodies[0];
    return force ? this.arrowFrom(this.linkage.point(pose, body, joint.name), force, force.role, i) : [];
  }

  // A load, to where it acts.
  pushed(load, pose, i) {
    const {x, y, angle} = pose[load.body], [u, v] = load.point;
    const at = [x + u * Math.cos(angle) - v * Math.sin(angle), y + u * Math.sin(angle) + v * Math.cos(angle)];
    return this.arrowFrom(at, load, "bad", i, true);
  }

  arrowFrom(at, force, role, i, ends = false) {
    if (!known(force.x[i]) || !known(force.y[i])) return [];
    const per = (ARROW * this.height) / this.data.largest, whole = per * Math.hypot(force.x[i], force.y[i]);
    const shorter = Math.min(1, (1.5 * ARROW * this.height) / whole), [fx, fy] = [shorter * per * force.x[i], shorter * per * force.y[i]], size = Math.hypot(fx, fy);
    if (!(size >= 0.01 * this.height)) return [];
    const [x, y] = at.map((v) => 1e3 * v), start = ends ? [x - fx, y - fy] : [x, y], tip = [start[0] + fx, start[1] + fy];
    const [ux, uy] = [fx / size, fy / size], head = Math.min(0.035 * this.height, size / 2);
    const side = (s) => [tip[0] - head * (ux + s * 0.45 * uy), tip[1] - head * (uy - s * 0.45 * ux)];
    const points = [start, tip, side(1), tip, side(-1)];
    return [{name: "", x: points.map((p) => p[0]), y: points.map((p) => p[1]), role, mark: "line", level: 0, scale: true, labels: []}];
  }

  listReadout() {
    const body = this.find("readout");
    this.cells = this.data.readout.map((r) => {
      const row = html("tr", {}, body);
      html("th", {scope: "row"}, row, r.label);
      const cell = html("td", {class: "number"}, row);
      html("td", {}, row, r.unit);
      return cell;
    });
  }
}

// ---------------------------------------------------------------------- the page

const data = JSON.parse(document.getElementById("data").textContent);
const charts = figuresOf(document, data.figures);
const root = document.getElementById("mover");
if (root) new Mover(root, data.motion, (x, unit) => charts.forEach((c) => c.figure.x.unit === unit && c.mark(x)));
document.documentElement.classList.add("ready");
