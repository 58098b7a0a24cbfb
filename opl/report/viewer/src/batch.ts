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
      const value = (row: Element) => row.children[column].getAttribute("data-value") ?? row.children[column].textContent ?? "";
      const order = (a: Element, b: Element) => value(a).localeCompare(value(b), "en", { numeric: true }) * (down ? -1 : 1);
      body?.append(...[...body.children].sort(order));
    });
  });
}
