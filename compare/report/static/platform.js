"use strict";
// The poses of a platform on a canvas, coloured by a quantity; the one that is picked is drawn as a linkage.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const get = (id) => document.getElementById(id);
  const canvas = get("canvas"), pen = canvas.getContext("2d"), chooser = get("quantity"), slider = get("pose");
  const [xs, ys] = data.place;
  const reached = xs.map((x, i) => (x === null || ys[i] === null ? -1 : i)).filter((i) => i >= 0);
  let picked = reached[Math.floor(reached.length / 2)];

  // ------------------------------------------------------------ the frame: all poses and the ground's points are in it
  const box = { left: Infinity, right: -Infinity, low: Infinity, high: -Infinity };
  const include = (x, y) => {
    box.left = Math.min(box.left, x); box.right = Math.max(box.right, x);
    box.low = Math.min(box.low, y); box.high = Math.max(box.high, y);
  };
  Object.values(data.parts.ground).forEach(([x, y]) => include(x, y));
  reached.forEach((i) => include(xs[i], ys[i]));
  for (const i of [reached[0], picked, reached[reached.length - 1]]) joints(i).flat().forEach((z) => include(...z));
  const side = 1.12 * Math.max(box.right - box.left, box.high - box.low) || 1;
  const centre = [(box.left + box.right) / 2, (box.low + box.high) / 2];
  const scale = canvas.width / side;
  const at = (x, y) => [canvas.width / 2 + (x - centre[0]) * scale, canvas.height / 2 - (y - centre[1]) * scale];
  const back = (u, v) => [centre[0] + (u - canvas.width / 2) / scale, centre[1] - (v - canvas.height / 2) / scale];

  function joints(i) {
    return data.parts.bodies.map((body) => {
      const [x, y, angle] = data.poses[body.name].map((series) => series[i]);
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      const corners = Object.values(body.points).map(([p, q]) => [x + c * p - s * q, y + s * p + c * q]);
      return corners.length > 1 ? corners : [...corners, [x, y]];
    });
  }

  // ------------------------------------------------------------ colours: viridis, by nine of its stops
  const stops = ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"]
    .map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));
  function colour(share) {
    const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(place), stops.length - 2);
    return `rgb(${stops[k].map((v, j) => Math.round(v + (place - k) * (stops[k + 1][j] - v))).join()})`;
  }
  get("bar").style.background = `linear-gradient(to right, ${stops.map((_, k) => colour(k / (stops.length - 1))).join()})`;

  function range(map) {
    const known = reached.map((i) => map.values[i]).filter((v) => v !== null && (!map.decades || v > 0)).sort((a, b) => a - b);
    const high = known[Math.min(known.length - 1, Math.floor(0.98 * known.length))], low = known[0];
    return map.decades ? [Math.log10(low), Math.log10(high)] : [low, high];
  }

  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const told = (value) => (value === null ? "–" : Number(value.toPrecision(4)).toString().replace("-", "−"));

  function draw() {
    const map = data.maps[chooser.selectedIndex], [low, high] = range(map);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    let [width, height] = [9, 9];
    if (data.grid) {
      const [nx, ny, gx, gy] = data.grid;
      width = nx > 1 ? ((gx[nx - 1] - gx[0]) / (nx - 1)) * scale + 0.6 : 9;
      height = ny > 1 ? ((gy[ny - 1] - gy[0]) / (ny - 1)) * scale + 0.6 : 9;
    }
    if (!data.grid) { // a path's darkest colours are seen on a dark ground, too
      pen.fillStyle = style("--frame");
      for (const i of reached) {
        const [u, v] = at(xs[i], ys[i]);
        pen.fillRect(u - width / 2 - 2, v - height / 2 - 2, width + 4, height + 4);
      }
    }
    for (const i of reached) {
      const value = map.values[i], [u, v] = at(xs[i], ys[i]);
      const share = value === null ? null : ((map.decades ? Math.log10(value) : value) - low) / (high - low || 1);
      pen.fillStyle = share === null ? style("--grid") : colour(share);
      pen.fillRect(u - width / 2, v - height / 2, width, height);
    }
    linkage();
    const shown = (value) => `${told(map.decades ? 10 ** value : value)} ${map.unit === "1" ? "" : map.unit}`;
    get("low").textContent = shown(low);
    get("high").textContent = `${shown(high)} (98 % of the poses are below)`;
    readout();
  }

  function stroke(points, closed) {
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(...at(x, y)) : pen.moveTo(...at(x, y))));
    if (closed) pen.closePath();
    pen.stroke();
  }

  function linkage() {
    for (const [colourName, wide] of [["--card", 9], ["--ink", 4]]) {
      pen.lineWidth = wide; pen.lineJoin = pen.lineCap = "round"; pen.strokeStyle = style(colourName);
      joints(picked).forEach((corners) => stroke(corners, corners.length > 2));
    }
    pen.fillStyle = style("--card"); pen.lineWidth = 2;
    joints(picked).flat().forEach(([x, y]) => { pen.beginPath(); pen.arc(...at(x, y), 5, 0, 7); pen.fill(); pen.stroke(); });
    pen.fillStyle = style("--frame");
    Object.values(data.parts.ground).forEach(([x, y]) => { const [u, v] = at(x, y); pen.fillRect(u - 7, v - 7, 14, 14); });
    if (!data.farthest || data.farthest[0][picked] === null) return;
    const [size, direction] = data.farthest.map((series) => series[picked]), reach = 100 * size;
    pen.strokeStyle = style("--bad"); pen.lineWidth = 4;
    const [c, s] = [reach * Math.cos(direction), reach * Math.sin(direction)];
    stroke([[xs[picked] - c, ys[picked] - s], [xs[picked] + c, ys[picked] + s]]);
  }

  function readout() {
    const where = data.time ? `at ${told(data.time[picked])} s` : `x ${told(1e3 * xs[picked])} mm, y ${told(1e3 * ys[picked])} mm`;
    get("where").textContent = `The pose ${where}`;
    const drives = Object.entries(data.drives).map(([name, series]) => [`drive ${name}`, series[picked], ""]);
    const rows = [...drives, ...data.maps.map((map) => [map.title, map.values[picked], map.unit === "1" ? "" : map.unit])];
    get("readout").replaceChildren(...rows.map(([title, value, unit]) => {
      const row = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
      head.textContent = title; head.scope = "row"; cell.textContent = `${told(value)} ${unit}`; cell.className = "number";
      row.append(head, cell);
      return row;
    }));
    slider.value = reached.indexOf(picked);
    slider.setAttribute("aria-valuetext", get("where").textContent);
  }

  function pick(i) {
    if (i === undefined || i < 0) return;
    picked = i;
    draw();
  }

  function nearest(x, y) {
    return reached.reduce((best, i) => (Math.hypot(xs[i] - x, ys[i] - y) < Math.hypot(xs[best] - x, ys[best] - y) ? i : best), picked);
  }

  function beside(key) {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: 1, ArrowDown: -1 }[key];
    if (!data.grid) return reached[reached.indexOf(picked) + step];
    const [nx, ny] = data.grid, across = key === "ArrowLeft" || key === "ArrowRight";
    const [row, column] = [Math.floor(picked / nx) + (across ? 0 : step), (picked % nx) + (across ? step : 0)];
    const there = row * nx + column;
    return row >= 0 && row < ny && column >= 0 && column < nx && xs[there] !== null ? there : picked;
  }

  data.maps.forEach((map) => chooser.add(new Option(`${map.title}${map.unit === "1" ? "" : ` (${map.unit})`}`)));
  slider.max = reached.length - 1;
  chooser.addEventListener("change", draw);
  slider.addEventListener("input", () => pick(reached[Number(slider.value)]));
  canvas.addEventListener("pointerdown", (event) => {
    const frame = canvas.getBoundingClientRect(), by = canvas.width / frame.width;
    pick(nearest(...back((event.clientX - frame.left) * by, (event.clientY - frame.top) * by)));
  });
  canvas.addEventListener("keydown", (event) => {
    if (!event.key.startsWith("Arrow")) return;
    event.preventDefault();
    pick(beside(event.key));
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
