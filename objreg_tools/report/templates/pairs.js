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

  function picture(figure, uri, caption) {
    figure.hidden = !uri;
    if (uri) figure.querySelector("img").src = uri;
    if (caption) figure.querySelector("figcaption").textContent = caption;
  }

  function listEvidence(numbers) {
    part(".evidence").replaceChildren(...numbers.map(([name, value]) => {
      const item = document.createElement("li"), label = document.createElement("span");
      label.textContent = name;
      item.append(label, value);
      return item;
    }));
  }

  function open(key) {
    const pair = data.pairs[key], row = rows.find((other) => other.dataset.pair === key);
    const seconds = [row.dataset.from, row.dataset.to].map((text) => parseFloat(text).toFixed(1) + " s");
    part(".verdict").replaceChildren(row.querySelector(".tag").cloneNode(true));
    part(".place").textContent = seconds.join(" ↔ ") + (row.querySelector(".labels").textContent && ", ")
      + row.querySelector(".labels").textContent;
    part(".words").textContent = pair.text;
    part(".meaning").textContent = pair.meaning;
    picture(part(".from"), data.moments[pair.from], seconds[0]);
    picture(part(".to"), data.moments[pair.to], seconds[1]);
    picture(part(".over"), data.overlays[key]);
    part(".blind").hidden = Boolean(data.moments[pair.from] || data.moments[pair.to]);
    listEvidence(pair.evidence);
    for (const link of article.querySelectorAll("[data-of]")) link.classList.toggle("chosen", link.dataset.of === key);
    if (!pane.open) pane.showModal();
    pane.dataset.pair = key;
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
    if (event.key === "Enter") open(event.target.closest("tr").dataset.pair);
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
