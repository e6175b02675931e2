// SPDX-License-Identifier: Apache-2.0
// Tables that are sorted by a column and searched by text: section.table, th[data-sort], td[data-value].
"use strict";

function browseTable(section) {
  const body = section.querySelector("tbody"), heads = [...section.querySelectorAll("thead th")];
  const rows = [...body.rows], search = section.querySelector("input[type=search]");
  const count = section.querySelector(".count");

  function filter() {
    const parts = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const row of rows) {
      const text = (row.textContent + " " + (row.dataset.search || "")).toLowerCase();
      row.hidden = !parts.every((part) => text.includes(part));
    }
    const shown = rows.filter((row) => !row.hidden).length;
    count.textContent = shown + " of " + rows.length;
  }

  // Rows without the value come last in both orders; numbers go down first, texts up.
  function sort(head) {
    const numeric = head.dataset.sort === "number", first = numeric ? "descending" : "ascending";
    const order = head.getAttribute("aria-sort") !== first ? first : numeric ? "ascending" : "descending";
    for (const other of heads) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", order);
    const column = heads.indexOf(head), sign = order === "ascending" ? 1 : -1;
    const text = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
    const lacks = (row) => text(row) === "" || (numeric && isNaN(parseFloat(text(row))));
    const known = rows.filter((row) => !lacks(row));
    known.sort((a, b) => sign * (numeric ? parseFloat(text(a)) - parseFloat(text(b))
      : text(a).localeCompare(text(b), undefined, { numeric: true })));
    body.append(...known, ...rows.filter(lacks));
  }

  if (search) search.addEventListener("input", filter);
  for (const head of heads.filter((one) => one.dataset.sort)) {
    head.querySelector("button").addEventListener("click", () => sort(head));
  }
}

document.querySelectorAll("section.table").forEach(browseTable);
