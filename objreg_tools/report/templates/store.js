// SPDX-License-Identifier: Apache-2.0
// The search of a store's page: rows of the table that do not match are hidden, dots and names are dimmed.
(() => {
  const box = document.querySelector(".search input");
  const said = document.querySelector(".search [role=status]");
  const rows = [...document.querySelectorAll("tr[data-name]")];
  const marks = [...document.querySelectorAll("figure svg circle[class*=series], figure svg text.name")];
  const nameOf = (mark) => (mark.querySelector("title") || mark).textContent.split(",")[0];

  function search() {
    const wanted = box.value.trim().toLowerCase();
    const matches = (name) => name.toLowerCase().includes(wanted);
    for (const row of rows) row.hidden = !matches(row.dataset.name);
    for (const mark of marks) mark.classList.toggle("dim", !matches(nameOf(mark)));
    said.textContent = wanted ? `${rows.filter((row) => !row.hidden).length} of ${rows.length} objects` : "";
  }

  box.addEventListener("input", search);
  box.form.addEventListener("submit", (event) => event.preventDefault());
})();
