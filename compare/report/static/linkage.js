// A linkage in a pose: where its points are, and what it is drawn from.
"use strict";

class Linkage {
  constructor(parts) {
    this.parts = parts;
    this.bodies = Object.fromEntries(parts.bodies.map((b) => [b.name, b]));
  }

  // The pose of sample i of a body's series (x, y in m, angle in rad); null where any is unknown.
  pose(poses, i) {
    const found = {};
    for (const [body, values] of Object.entries(poses ?? {})) {
      const [x, y, angle] = [values.x[i], values.y[i], values.angle[i]];
      if (![x, y, angle].every(known)) return null;
      found[body] = {x, y, angle};
    }
    return Object.keys(found).length ? found : null;
  }

  // Ideal pose plus the magnified way from there to the displaced one.
  magnified(pose, ideal, times) {
    if (!pose || !ideal || times === 1) return pose;
    const part = (body, key) => ideal[body][key] + times * (pose[body][key] - ideal[body][key]);
    return Object.fromEntries(Object.keys(pose).map((b) => [b, {x: part(b, "x"), y: part(b, "y"), angle: part(b, "angle")}]));
  }

  // One frame (mm) for a whole motion, so that the drawing does not jump.
  frame(poses, share = 0.08) {
    const points = Object.values(this.parts.ground);
    for (const pose of poses) if (pose) for (const b of this.parts.bodies) for (const p of Object.keys(b.points)) points.push(this.point(pose, b.name, p));
    const [left, right] = extent(points.map((p) => 1e3 * p[0]), 0), [low, high] = extent(points.map((p) => 1e3 * p[1]), 0);
    const spare = share * Math.max(right - left, high - low);
    return {x: [left - spare, right + spare], y: [low - spare, high + spare]};
  }

  point(pose, body, name) {
    if (body === "ground") return this.parts.ground[name];
    const {x, y, angle} = pose[body], [u, v] = this.bodies[body].points[name];
    return [x + u * Math.cos(angle) - v * Math.sin(angle), y + u * Math.sin(angle) + v * Math.cos(angle)];
  }

  // Links, slides, clearance circles, pivots and labelled joints of one configuration, as series of a plane (mm).
  drawn(pose, name, role, gaps, labelled = role === "analytic") {
    const series = [], links = [];
    const add = (points, mark, extra = {}) => series.push({name: "", x: points.map((p) => p && 1e3 * p[0]), y: points.map((p) => p && 1e3 * p[1]), role, mark, level: 0, scale: true, labels: [], ...extra});
    for (const body of this.parts.bodies) {
      const corners = Object.keys(body.points).map((p) => this.point(pose, body.name, p));
      if (corners.length === 1) corners.push([pose[body.name].x, pose[body.name].y]);
      links.push(...corners, ...(corners.length > 2 ? [corners[0]] : []), null);
    }
    add(links, role === "ideal-line" ? "dashed" : "link", {name});
    for (const joint of this.parts.joints.filter((j) => j.axis)) {
      const [first, second] = joint.bodies, turn = first === "ground" ? 0 : pose[first].angle;
      const angle = Math.atan2(joint.axis[1], joint.axis[0]) + turn, size = 0.2 * this.parts.size;
      const [cx, cy] = this.point(pose, second, joint.name);
      const at = (u, v) => [cx + size * (u * Math.cos(angle) - v * Math.sin(angle)), cy + size * (u * Math.sin(angle) + v * Math.cos(angle))];
      add([at(-4, 0), at(4, 0)], "dashed", {role: "frame"});
      add([at(1, 0.6), at(-1, 0.6), at(-1, -0.6), at(1, -0.6), at(1, 0.6)], "line", labelled ? {labels: [joint.name]} : {});
    }
    for (const [joint, gap] of Object.entries(gaps)) {
      const [cx, cy] = this.point(pose, this.parts.joints.find((j) => j.name === joint).bodies[1], joint);
      add(circle(cx, cy, gap), "line");
    }
    const pins = this.parts.joints.filter((j) => !j.axis);
    const label = labelled ? {labels: pins.map((j) => j.name)} : {};
    if (labelled) add(pins.filter((j) => j.bodies.includes("ground")).map((j) => this.parts.ground[j.name]), "pivot", {role: "frame"});
    add(pins.map((j) => this.point(pose, j.bodies[0], j.name)), "joint", label);
    return series;
  }
}

function circle(cx, cy, radius) {
  return Array.from({length: 61}, (_, k) => [cx + radius * Math.cos((k * Math.PI) / 30), cy + radius * Math.sin((k * Math.PI) / 30)]);
}
