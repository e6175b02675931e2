// SPDX-License-Identifier: Apache-2.0
// Asks for the state of the graph each second and draws it. All texts are of other nodes, so none becomes HTML.
"use strict";
const EVERY_MS = 1000, SHOWN = 12, SVG = "http://www.w3.org/2000/svg";
const find = (id) => document.getElementById(id);

function element(kind, text, style) {
  const made = document.createElement(kind);
  made.textContent = text ?? "";
  if (style) made.className = style;
  return made;
}

function table(id, head, rows, empty) {
  const place = find(id), numbers = head.map((name) => name.startsWith("#"));
  const line = (kind, cells) => {
    const row = document.createElement("tr");
    row.append(...cells.map((cell, k) => element(kind, cell, numbers[k] ? "number" : "")));
    return row;
  };
  const titles = line("th", head.map((name) => name.replace("#", "")));
  place.replaceChildren(titles, ...(rows.length ? rows : [[empty]]).map((cells) => line("td", cells)));
}

const number = (value, digits) => (value === null || value === undefined ? "" : value.toFixed(digits));
const seconds = (row) => `${time(row.from_ns)} ↔ ${time(row.to_ns)}`;
const time = (stamp_ns) => (Number((BigInt(stamp_ns) - began_ns) / 1000000n) / 1000).toFixed(2);
let began_ns = 0n; // the first stamp, from which all times count
const total = (counts) => Object.values(counts).reduce((sum, count) => sum + count, 0);

function tiles(state) {
  const drops = state.nodes.reduce((sum, node) => sum + total(node.dropped), 0);
  const frames = Math.max(0, ...state.nodes.map((node) => node.received));
  const shown = [["frames", frames, `${drops} dropped`], ["constraints", state.counts.constraints ?? 0, ""],
    ["refused", total(state.rejected), ""], ["keyframes", state.counts["stored keyframes"] ?? 0,
      `${state.counts["waiting keyframes"] ?? 0} wait`], ["landmarks", state.counts["stored landmarks"] ?? 0, ""]];
  find("tiles").replaceChildren(...shown.map(([name, value, note]) => {
    const tile = element("div", "", "card tile");
    tile.append(element("div", name, "name"), element("div", value, "value"), element("div", note, "note"));
    return tile;
  }));
}

function line(points, style, at) {
  const made = document.createElementNS(SVG, "polyline");
  made.setAttribute("points", points.map((point) => at(point).map((v) => v.toFixed(1)).join(",")).join(" "));
  made.setAttribute("class", `line ${style}`);
  return made;
}

function above(state) {
  // What was accepted is drawn over what was refused.
  const pairs = [["rejected", "faint"], ["accepted", "accepted link"]].flatMap(([name, style]) =>
    (state.edges[name] ?? []).flatMap((point, k, all) => (k % 2 ? [[[all[k - 1], point], style]] : [])));
  const objects = state.objects.map(([name, x, y]) => [name, [x, y]]);
  const all = [...state.odometry, ...state.corrected, ...pairs.flatMap(([ends]) => ends), ...objects.map((o) => o[1])];
  if (!all.length) return;
  const range = [0, 1].map((axis) => all.reduce(([low, high], point) =>
    [Math.min(low, point[axis]), Math.max(high, point[axis])], [Infinity, -Infinity]));
  const scale = Math.min(560 / Math.max(range[0][1] - range[0][0], 0.5), 410 / Math.max(range[1][1] - range[1][0], 0.5));
  const middle = range.map(([low, high]) => (low + high) / 2);
  const at = ([x, y]) => [300 + (x - middle[0]) * scale, 225 - (y - middle[1]) * scale];
  const drawn = pairs.map(([ends, style]) => line(ends, style, at));
  if (state.odometry.length) drawn.push(line(state.odometry, "odometry", at));
  if (state.corrected.length) drawn.push(line(state.corrected, "corrected", at));
  const dots = objects.map(([name, point]) => {
    const dot = document.createElementNS(SVG, "circle"), title = document.createElementNS(SVG, "title");
    const [x, y] = at(point);
    for (const [key, value] of [["cx", x], ["cy", y], ["r", 4], ["class", "dot seen"]]) dot.setAttribute(key, value);
    title.textContent = name;
    dot.append(title);
    return dot;
  });
  find("above").replaceChildren(...drawn, ...dots);
}

function show(state) {
  began_ns = BigInt(state.began ?? 0);
  const silent = state.nodes.filter((node) => node.silent).map((node) => node.name);
  find("state").className = silent.length ? "state gone" : "state";
  find("state").textContent = !state.nodes.length ? "No node reports yet: is a graph running in this domain?"
    : silent.length ? `Silent: ${silent.join(", ")}` : `${state.nodes.length} nodes, watched for ${state.seconds} s`;
  tiles(state);
  above(state);
  if (state.picture !== null && find("sight").dataset.stamp !== state.picture) {
    find("sight").dataset.stamp = state.picture;
    find("sight").src = `picture.jpg?${state.picture}`;
    find("sight").hidden = false;
    find("sighted").textContent = `The picture of ${time(state.picture)} s, with what was found in it.`;
  }
  table("nodes", ["node", "#in", "#out", "#waiting", "dropped", "says"], state.nodes.map((node) => [node.name,
    node.received, node.published, node.waiting,
    Object.entries(node.dropped).map(([reason, count]) => `${count} ${reason}`).join(", "),
    (node.warns ? "! " : "") + node.message]), "none yet");
  table("closures", ["when [s]", "objects", "#score", "#odds"], state.closures.slice(0, SHOWN).map((row) =>
    [seconds(row), row.labels, number(row.score, 2), number(row.odds, 1)]), "none yet");
  table("refusals", ["when [s]", "reason", "detail"], state.refusals.slice(0, SHOWN).map((row) =>
    [seconds(row), row.reason.replaceAll("_", " "), row.detail]), "none yet");
  table("rejected", ["refused because", "#times"], Object.entries(state.rejected).map(([reason, count]) =>
    [reason.replaceAll("_", " "), count]), "none yet");
  table("stages", ["node", "stage", "#median [ms]", "#95 % [ms]"], state.nodes.flatMap((node) =>
    node.stages.map(([stage, p50, p95]) => [node.name, stage, number(p50, 1), number(p95, 1)])), "none yet");
}

async function ask() {
  try {
    const answer = await fetch("state.json", { cache: "no-store" });
    show(await answer.json());
  } catch {
    find("state").className = "state gone";
    find("state").textContent = "No answer: objreg watch has ended.";
  }
  setTimeout(ask, EVERY_MS);
}
ask();
