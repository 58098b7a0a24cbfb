// The table of a batch: a click on a heading sorts the rows by its column, once more the other way.

for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.querySelector("tbody");
  table.querySelectorAll<HTMLElement>("thead th").forEach((head, column) => {
    const button = head.appendChild(document.createElement("button"));
    button.append(...[...head.childNodes].slice(0, -1));
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of table.querySelectorAll("[aria-sort]")) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const text = (row: Element) => row.children[column].textContent ?? "";
      const number = (row: Element) => (text(row) === "" || Number.isNaN(Number(text(row))) ? Number.POSITIVE_INFINITY : Number(text(row)));
      const order = (a: Element, b: Element) => number(a) - number(b) || text(a).localeCompare(text(b), "en", { numeric: true });
      body?.append(...[...body.children].sort((a, b) => order(a, b) * (down ? -1 : 1)));
    });
  });
}
