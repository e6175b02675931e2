// SPDX-License-Identifier: Apache-2.0
// Drawings in 3D: the trajectory with its closures and objects, and both clouds of the pair that a pane shows.
// plotly.js is in the page as a gzip in base64, and is unpacked for the first drawing.
"use strict";

(() => {
  const TINTS = { tint: [(grey) => `rgb(0,${grey},0)`, (grey) => `rgb(${grey},0,${grey})`] };
  const CONFIG = { displaylogo: false, responsive: true, modeBarButtonsToRemove: ["sendChartToCloud"] };
  const spaces = [];
  let library;

  async function load() {
    if (!document.createElement("canvas").getContext("webgl")) throw new Error("WebGL is off");
    const script = document.createElement("script");
    script.textContent = await unzipped(document.querySelector("script.plotly").textContent).text();
    document.head.append(script);
    return window.Plotly;
  }

  // x, y and z of points as packed.py packs them.
  function points({ low, step, xyz }) {
    const steps = new Uint16Array(bytes(xyz).buffer), count = steps.length / 3;
    return [0, 1, 2].map((axis) =>
      Float64Array.from(steps.subarray(axis * count, (axis + 1) * count), (value) => low[axis] + step * value));
  }

  const isNarrow = matchMedia("(max-width: 560px)");
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

  // Where the eye is, in plotly's unit, the mean extent: the further, the longer the longest extent is beside that.
  function eyeFor(direction, traces) {
    const spans = ["x", "y", "z"].map((axis) => {
      let low = Infinity, high = -Infinity;
      for (const trace of traces) for (const value of trace[axis]) {
        if (value !== null) [low, high] = [Math.min(low, value), Math.max(high, value)];
      }
      return high > low ? high - low : 2;
    });
    const far = Math.max(...spans) / Math.cbrt(spans[0] * spans[1] * spans[2]);
    return { x: far * direction[0], y: far * direction[1], z: far * direction[2] };
  }

  function layout(eye) {
    const axis = (title) => ({ title: { text: title }, color: colour("soft"), gridcolor: colour("rule"),
      zerolinecolor: colour("rule"), showbackground: false, showspikes: false });
    return {
      paper_bgcolor: colour("card"), font: { color: colour("soft"), size: 12 }, margin: { l: 0, r: 0, t: 0, b: 0 },
      legend: { orientation: "h", x: 0, y: 0, yanchor: "top", itemsizing: "constant" }, uirevision: "kept",
      hoverlabel: { bgcolor: colour("card"), bordercolor: colour("faint"), font: { color: colour("ink") } },
      scene: { aspectmode: "data", xaxis: axis("m"), yaxis: axis("m"), zaxis: axis("m up"), dragmode: "turntable",
        camera: { eye, up: { x: 0, y: 0, z: 1 } } },
    };
  }

  function trace(packed, mode, more) {
    const [x, y, z] = points(packed);
    return { type: "scatter3d", mode, x, y, z, name: packed.name, hoverinfo: "name", ...more };
  }

  // Pairs of ends as one line with gaps, which carries the key and the text of each.
  function links(group) {
    const [x, y, z] = points(group).map((axis) => [...axis].flatMap((v, k) => (k % 2 ? [v, null] : [v])));
    const thrice = (values) => values.flatMap((value) => [value, value, value]);
    const line = { color: colour(group.style), width: 3, dash: group.pruned ? "dash" : "solid" };
    return { type: "scatter3d", mode: "lines+markers", x, y, z, name: group.name, line, hoverinfo: "text",
      marker: { color: colour(group.style), size: 3 }, text: thrice(group.text), customdata: thrice(group.keys) };
  }

  function world(scene) {
    const trajectories = scene.trajectories.map((line) =>
      trace(line, "lines", { line: { color: colour(line.style), width: line.style === "true" ? 7 : 4 } }));
    const objects = scene.objects.map((cluster) =>
      trace(cluster, "markers", { marker: { color: colour(cluster.style), size: 2.5 } }));
    const names = trace(scene.names, "text", { text: scene.names.text, textfont: { color: colour("ink"),
      size: isNarrow.matches ? 10 : 13 }, showlegend: false, hoverinfo: "skip" });
    return [...trajectories, ...scene.closures.map(links), ...objects, names];
  }

  // What a camera measured on its grid of pixels: x, y and z of each point in its frame, and its column and row.
  async function measured({ depth, unit, columns, camera: [fx, fy, cx, cy] }) {
    const seen = [];
    new Uint16Array(await unzipped(depth).arrayBuffer()).forEach((value, n) => {
      const u = n % columns, v = Math.floor(n / columns), z = unit * value;
      if (value) seen.push({ x: (u - cx) * z / fx, y: (v - cy) * z / fy, z, u, v });
    });
    return seen;
  }

  // Points after a pose (3, 4), row by row, with z up and y ahead.
  function placed(seen, pose) {
    const row = (k) => seen.map(({ x, y, z }) => pose[k] * x + pose[k + 1] * y + pose[k + 2] * z + pose[k + 3]);
    return { x: row(0), y: row(8), z: row(4).map((value) => -value) };
  }

  // The colours of points in the picture of their moment.
  async function painted(seen, [step, width, height], uri, tint) {
    const image = new Image();
    image.src = uri;
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: image.naturalWidth, height: image.naturalHeight });
    const brush = canvas.getContext("2d", { willReadFrequently: true });
    brush.drawImage(image, 0, 0);
    const { data } = brush.getImageData(0, 0, canvas.width, canvas.height);
    const at = (cell, size, shown) => Math.floor((step * cell + Math.floor(step / 2) + 0.5) / size * shown);
    return seen.map(({ u, v }) => {
      const pixel = 4 * (canvas.width * at(v, height, canvas.height) + at(u, width, canvas.width));
      const [red, green, blue] = data.subarray(pixel, pixel + 3);
      return tint ? tint(Math.round(90 + 0.2 * red + 0.35 * green + 0.07 * blue)) : `rgb(${red},${green},${blue})`;
    });
  }

  function pair(clouds, { moments, pairs }, key, paint) {
    const poses = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0], clouds.poses[key]];
    return Promise.all(["from", "to"].map(async (end, k) => {
      const stamp = pairs[key][end], cloud = clouds.moments[stamp], seen = await measured(cloud);
      const marker = { size: 2.2, color: await painted(seen, cloud.grid, moments[stamp], TINTS[paint]?.[k]) };
      return { type: "scatter3d", mode: "markers", ...placed(seen, poses[k]), marker, hoverinfo: "skip",
        showlegend: false };
    }));
  }

  // A place with a button and a drawing. `traces` gives what is drawn, at once or later, or a text of why there is nothing;
  // `chosen` receives the point that was clicked.
  class Space {
    constructor(place, direction, traces, chosen) {
      Object.assign(this, { direction, traces, chosen, open: false, turn: 0, drawing: Promise.resolve() });
      [this.button, this.notice, this.plot] = [".draw", ".notice", ".plot"].map((name) => place.querySelector(name));
      this.label = this.button.textContent;
      this.button.addEventListener("click", () => { this.open = !this.open; this.draw(); });
      spaces.push(this);
    }

    // One drawing after another, and only the last that was asked for: a browser has few WebGL contexts.
    draw() {
      const turn = ++this.turn;
      this.drawing = this.drawing.then(() => turn === this.turn && this.drawNow());
    }

    async drawNow() {
      this.button.setAttribute("aria-expanded", this.open);
      this.button.textContent = this.open ? "Hide the 3D view" : this.label;
      const drawn = this.open ? await this.traces() : "";
      this.plot.hidden = typeof drawn === "string";
      this.notice.textContent = this.plot.hidden ? drawn : "";
      if (!this.plot.hidden) await this.show(drawn).catch((error) => this.fail(error));
    }

    async show(drawn) {
      if (!library) this.notice.textContent = "Loading…";
      const Plotly = await (library ??= load());
      this.notice.textContent = "";
      const isFirst = !this.plot.data;
      await Plotly.react(this.plot, drawn, layout(eyeFor(this.direction, drawn)), CONFIG);
      if (isFirst && this.chosen) this.plot.on("plotly_click", (event) => this.chosen(event.points[0]));
      if (this.plot._fullLayout.width !== this.plot.clientWidth) await Plotly.Plots.resize(this.plot);
    }

    fail(error) {
      this.plot.hidden = true;
      this.notice.textContent = `This browser cannot draw it in 3D: ${error.message}.`;
    }
  }

  function addWorld(article) {
    const place = article.querySelector(".world");
    if (!place) return;
    const traces = () => world(JSON.parse(place.querySelector("script.scene").textContent));
    const open = (key) => article.dispatchEvent(new CustomEvent("open-pair", { detail: key }));
    new Space(place, [-0.75, -1.05, 0.9], traces, (point) => point.customdata && open(point.customdata));
  }

  function addPair(article) {
    const pane = article.querySelector("dialog.pane"), stored = article.querySelector("script.clouds");
    if (!stored) return;
    const place = pane.querySelector(".space"), paint = place.querySelector(".paint");
    const data = JSON.parse(article.querySelector("script.data").textContent);
    let clouds;
    const space = new Space(place, [0.2, -1.3, 0.5], () => {
      const key = place.dataset.pair;
      clouds ??= JSON.parse(stored.textContent);
      if (clouds.poses[key]) return pair(clouds, data, key, paint.querySelector("select").value);
      return `There are no clouds of this pair: ${clouds.absent[key] ?? "no pose was found for it"}.`;
    });
    paint.addEventListener("change", () => space.draw());
    place.addEventListener("pair", () => space.draw());
  }

  for (const article of document.querySelectorAll("article.run")) {
    addWorld(article);
    addPair(article);
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const space of spaces) if (space.open && space.plot.checkVisibility()) space.draw();
  });
})();
