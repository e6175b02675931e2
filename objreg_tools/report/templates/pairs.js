// SPDX-License-Identifier: Apache-2.0
// All pairs of a run: filter, sort, and a pane with the pictures of one. The pane gives its `.space` the pair that
// it shows, by data-pair and an event "pair": other drawings of a pair go there.
"use strict";

function browse(article) {
  const section = article.querySelector("section.pairs");
  if (!section) return;
  const body = section.querySelector("tbody");
  const rows = [...body.rows];
  const data = JSON.parse(section.querySelector("script.data").textContent);
  const marks = unzipped(data.marks).json();
  const pane = section.querySelector("dialog");
  const part = (selector) => pane.querySelector(selector);

  function showThumbs() {
    for (const row of rows) {
      const uri = data.overlays[row.dataset.pair] || data.moments[data.pairs[row.dataset.pair].to];
      if (!uri) continue;
      const image = new Image();
      image.alt = "";
      image.loading = "lazy";
      image.src = uri;
      row.querySelector(".thumb").append(image);
    }
  }

  function filter(kind) {
    for (const row of rows) row.hidden = kind !== "" && row.dataset.reason !== kind && row.dataset.verdict !== kind;
    const shown = rows.filter((row) => !row.hidden).length;
    section.querySelector(".count").textContent = shown + (shown === 1 ? " pair" : " pairs");
  }

  // Rows without the number come last in both orders.
  function sort(head) {
    const down = head.getAttribute("aria-sort") !== "descending";
    for (const other of section.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const value = (row) => parseFloat(row.dataset[head.dataset.sort] ?? "NaN");
    const known = rows.filter((row) => !isNaN(value(row)));
    known.sort((a, b) => (down ? value(b) - value(a) : value(a) - value(b)));
    body.append(...known, ...rows.filter((row) => isNaN(value(row))));
  }

  function picture(figure, uri) {
    figure.hidden = !uri;
    if (uri) figure.querySelector("img").src = uri;
  }

  const signed = (number) => (number < 0 ? "−" : "+") + Math.abs(number).toFixed(2);

  // A bar from the middle: to the right what speaks for the pose, to the left what speaks against it.
  function bar(weight, longest) {
    const cell = document.createElement("td"), track = document.createElement("div");
    cell.className = "weigh";
    if (weight === null) return cell;
    const fill = document.createElement("i"), number = document.createElement("span");
    const width = 50 * Math.min(Math.abs(weight) / longest, 1);
    fill.className = weight < 0 ? "against" : "for";
    fill.style.width = width + "%";
    fill.style.left = (weight < 0 ? 50 - width : 50) + "%";
    number.textContent = signed(weight);
    track.append(fill);
    cell.append(track, number);
    return cell;
  }

  function evidenceRow(texts, weight, longest, style) {
    const row = document.createElement("tr");
    row.className = style;
    texts.forEach((text, k) => {
      const cell = document.createElement("td");
      cell.className = ["", "number", "detail"][k];
      cell.textContent = text;
      row.append(cell);
    });
    row.append(bar(weight, longest));
    return row;
  }

  // The odds in words, and what the gate asks for.
  function oddsText(pair) {
    const odds = 10 ** Math.abs(pair.total), count = odds < 10 ? odds.toFixed(1) : Number(odds.toPrecision(2));
    const [many, one] = pair.total < 0 ? ["false", "right"] : ["right", "false"];
    const late = pair.total < pair.least && pair.evidence.some(([key]) => key === "agreeing");
    return "By the evidence there are " + count + " " + many + " poses for each " + one + " one like this; the gate asks for "
      + Math.round(10 ** pair.least) + " right ones" + (late ? ", and for less where other keyframes agree" : "")
      + ". The bars add up to the logarithm of the odds; that of the sum has a scale of its own.";
  }

  // What was weighed, its sum, and below it the numbers that are only shown.
  function listEvidence(pair) {
    const kinds = data.kinds, numbers = pair.evidence;
    const named = (key) => kinds[key] || [key, ""];
    const longest = Math.max(...numbers.map(([, , weight]) => Math.abs(weight || 0)), 0.1);
    const row = ([key, value, weight]) => evidenceRow([named(key)[0], value, named(key)[1]], weight, longest, "");
    const isWeighed = ([, , weight]) => weight !== null;
    const rows = numbers.filter(isWeighed).map(row);
    if (pair.total !== null) {
      const sum = evidenceRow(["the sum, log₁₀ of the odds", "", "≥ " + pair.least.toFixed(2)], pair.total,
        Math.max(Math.abs(pair.total), pair.least), "sum");
      rows.push(sum);
    }
    part(".evidence tbody").replaceChildren(...rows, ...numbers.filter((one) => !isWeighed(one)).map(row));
    part(".evidence").hidden = numbers.length === 0;
    part(".verdict-of").textContent = pair.total === null ? "" : oddsText(pair);
  }

  // Thin lines between matched features, four numbers a line; no switch where there is no pose.
  function drawFeatures(features, svg) {
    part(".features").hidden = !features;
    const [text, ends] = features || ["", []];
    part(".counted").textContent = text;
    const lines = [];
    for (let k = 0; k < ends.length; k += 4) {
      const [x1, y1, x2, y2] = ends.slice(k, k + 4);
      lines.push(`<line x1="${x1}" y1="${y1}" x2="${x2}" y2="${y2}"/>`);
      lines.push(`<circle cx="${x1}" cy="${y1}" r="2"/><circle cx="${x2}" cy="${y2}" r="2"/>`);
    }
    svg.insertAdjacentHTML("afterbegin", `<g class="agree">${lines.join("")}</g>`);
  }

  function drawEnds(key, pair, seconds) {
    const figure = part(".ends"), svg = figure.querySelector("svg");
    const known = [data.moments[pair.from], pair.from === pair.to ? "" : data.moments[pair.to]];
    figure.hidden = !known[0] && !known[1];
    known.forEach((uri, k) => {
      const image = figure.querySelector(["img.from", "img.to"][k]);
      image.hidden = !uri;
      if (uri) image.src = uri;
    });
    svg.innerHTML = "";
    marks.then((all) => pane.dataset.pair === key && drawOver(svg, pair.features, ...(all[key] || ["", 240])));
    figure.querySelector("figcaption").textContent = (pair.from === pair.to ? seconds[0] : seconds.join(" ↔ ")) + (pair.lacking && ". " + pair.lacking);
  }

  function drawOver(svg, features, marks, height) {
    svg.setAttribute("viewBox", "0 0 648 " + height);
    svg.innerHTML = marks;
    drawFeatures(features, svg);
  }

  // Without a secure page, as of file://, some browsers have no clipboard: then the command is selected.
  function showCommand(where, command) {
    const again = part(where), code = again.querySelector("code"), button = again.querySelector("button");
    again.hidden = !command;
    code.textContent = command;
    button.textContent = "copy";
    button.onclick = () => {
      getSelection().selectAllChildren(code);
      navigator.clipboard?.writeText(command).then(() => (button.textContent = "copied"), () => {});
    };
  }

  function open(key) {
    pane.dataset.pair = key;
    const pair = data.pairs[key], row = rows.find((other) => other.dataset.pair === key);
    const seconds = [row.dataset.from, row.dataset.to].map((text) => parseFloat(text).toFixed(1) + " s");
    part(".verdict").replaceChildren(row.querySelector(".tag").cloneNode(true));
    part(".place").textContent = seconds.join(" ↔ ") + (row.querySelector(".labels").textContent && ", ")
      + row.querySelector(".labels").textContent;
    part(".words").textContent = pair.text;
    part(".meaning").textContent = pair.meaning;
    drawEnds(key, pair, seconds);
    picture(part(".over"), data.overlays[key]);
    part(".blind").hidden = Boolean(data.moments[pair.from] || data.moments[pair.to]);
    listEvidence(pair);
    showCommand(".again", pair.command);
    showCommand(".veto", pair.veto);
    for (const link of article.querySelectorAll("[data-of]")) link.classList.toggle("chosen", link.dataset.of === key);
    if (!pane.open) pane.showModal();
    const space = part(".space");
    space.dataset.pair = key;
    space.dispatchEvent(new CustomEvent("pair", { detail: key, bubbles: true }));
  }

  // The next of the rows that are shown, in their order.
  function step(by) {
    const shown = [...body.rows].filter((row) => !row.hidden).map((row) => row.dataset.pair);
    const place = shown.indexOf(pane.dataset.pair) + by;
    if (shown.length) open(shown[(place + shown.length) % shown.length]);
  }

  section.querySelector(".filter").addEventListener("change", (event) => filter(event.target.value));
  for (const head of section.querySelectorAll("th[data-sort]")) {
    head.querySelector("button").addEventListener("click", () => sort(head));
  }
  article.addEventListener("click", (event) => {
    const chosen = event.target.closest("tr[data-pair], svg [data-pair]");
    if (chosen) open(chosen.dataset.pair);
  });
  body.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault(); // or the key also presses the button that has the focus once the pane is open
    open(event.target.closest("tr").dataset.pair);
  });
  pane.addEventListener("keydown", (event) => {
    if (event.key === "ArrowRight") step(1);
    if (event.key === "ArrowLeft") step(-1);
  });
  pane.addEventListener("click", (event) => event.target === pane && pane.close());
  part(".next").addEventListener("click", () => step(1));
  part(".before").addEventListener("click", () => step(-1));
  part(".close").addEventListener("click", () => pane.close());
  article.addEventListener("open-pair", (event) => open(event.detail));
  showThumbs();
}

const articles = [...document.querySelectorAll("article.run")];
articles.forEach(browse);
for (const button of document.querySelectorAll("button.open")) {
  button.addEventListener("click", () => {
    articles[button.dataset.run].dispatchEvent(new CustomEvent("open-pair", { detail: button.dataset.pair }));
  });
}
