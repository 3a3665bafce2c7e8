// Keys, pictures and tables of the documentation site: what the theme lacks.
"use strict";

// The theme goes to another page at these letters, in the middle of a word even.
const LEAVING = ["n", "p", ",", "."];

document.addEventListener("keydown", (event) => {
  const entry = "input, textarea, select, [contenteditable]";
  if (event.composedPath()[0].matches?.(entry)) return;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (LEAVING.includes(event.key)) event.stopPropagation();
  if (event.key === "s") {
    event.preventDefault();
    document.querySelector("[data-md-component=search] button").click();
  }
});

const enlarged = document.createElement("dialog");
enlarged.className = "enlarged";
enlarged.addEventListener("click", () => enlarged.close());
document.body.append(enlarged);

for (const image of document.querySelectorAll("article img")) {
  const picture = image.closest("picture") ?? image;
  const button = document.createElement("button");
  button.className = "enlarge";
  button.addEventListener("click", () => {
    enlarged.replaceChildren(picture.cloneNode(true));
    enlarged.showModal();
  });
  picture.replaceWith(button);
  button.append(picture);
}

// A picture's dark form is the system's choice, until the reader makes one on the page.
function colour() {
  const dark = document.body.dataset.mdColorScheme === "slate";
  for (const source of document.querySelectorAll("picture source")) {
    source.media = dark ? "all" : "not all";
  }
}
new MutationObserver(colour).observe(document.body, {
  attributeFilter: ["data-md-color-scheme"],
});
colour();

// The more a cell says the wider it is, so that a table scrolls rather than ends in slivers.
for (const cell of document.querySelectorAll("td")) {
  cell.style.minWidth = `${Math.min(cell.textContent.length / 2, 28)}ch`;
}
