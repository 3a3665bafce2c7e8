// Helpers for the page: find and make elements, look up colours and the font.

/** The element with an id. */
export const find = (id) => document.getElementById(id);

/** Make an element with attributes (a property, if it has one of that name) and content. */
export function make(tag, attributes = {}, ...content) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...content);
  return element;
}

/** Make a button that reads like a link. */
export function link(text, act, className = "link") {
  const button = make("button", { type: "button", className }, text);
  button.addEventListener("click", act);
  return button;
}

/** Make an element of a drawing. */
export function shape(tag, attributes = {}) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/** Make a table with a heading for each column, if it has any, and for each row. */
export function table(caption, titles, rows, attributes = {}) {
  const head = titles.map((title) => (title ? make("th", { scope: "col" }, title) : make("td")));
  const cellOf = (cell) => (cell.tagName === "TD" ? cell : make("td", {}, cell));
  const body = rows.map(([name, ...rest]) =>
    make("tr", {}, make("th", { scope: "row" }, name), ...rest.map(cellOf)),
  );
  return make(
    "table",
    attributes,
    make("caption", { className: "unseen" }, caption),
    make("thead", { hidden: head.length === 0 }, make("tr", {}, ...head)),
    make("tbody", {}, ...body),
  );
}

/** Set an element's text, if it is another than before: setting it costs a layout. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Give an element these children, in any order; those it has already are not touched. */
export function keep(parent, children) {
  const wanted = new Set(children);
  for (const child of [...parent.children]) if (!wanted.has(child)) child.remove();
  parent.append(...children.filter((child) => child.parentNode !== parent));
}

/** So many of something: one, or several. */
export const counted = (count, what) => `${count} ${what}${count === 1 ? "" : "s"}`;

/** A number for people: whole, or with what digits it takes. */
export function number(value) {
  if (value === null || value === undefined) return "–";
  if (Number.isInteger(value)) return String(value);
  return Math.abs(value) >= 0.001 ? value.toFixed(4) : value.toExponential(1);
}

/** Have a button say something else for a moment. */
export function flash(button, text) {
  const before = button.dataset.says ?? button.textContent;
  button.dataset.says = before;
  button.textContent = text;
  setTimeout(() => (button.textContent = before), 1500);
}

// Tabs as they are known from elsewhere: one is on, arrows go to the next.

/**
 * Make a list of tabs work.
 *
 * @param {HTMLElement} list
 * @param {(panel: string) => void} show told the id of the panel that comes up
 * @param {string|null} first the panel to begin with; none of these: that of the first tab
 */
export function tabs(list, show, first) {
  const all = [...list.querySelectorAll('[role="tab"]')];
  const panel = (tab) => document.getElementById(tab.getAttribute("aria-controls"));
  const select = (chosen) => {
    for (const tab of all) {
      tab.setAttribute("aria-selected", tab === chosen);
      tab.tabIndex = tab === chosen ? 0 : -1;
      panel(tab).hidden = tab !== chosen;
    }
    show(panel(chosen).id);
  };
  for (const [number, tab] of all.entries()) {
    tab.addEventListener("click", () => select(tab));
    tab.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      const next = all[(number + by + all.length) % all.length];
      next.focus();
      select(next);
    });
  }
  select(all.find((tab) => tab.getAttribute("aria-controls") === first) ?? all[0]);
}

// The style sheet's colours, for what is painted by hand: one place says what they are.

const NAMES = [
  "bg", "panel", "ink", "mute", "line", "band", "accent", "bad", "first", "second", "third",
  "fourth", "guess",
];

/** The colours of the present scheme by name. */
export function palette() {
  // Only a property that takes colours has them worked out: light or dark.
  const probe = document.createElement("i");
  document.body.append(probe);
  const colours = {};
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}

const scheme = matchMedia("(prefers-color-scheme: dark)");

/** Have something painted anew whenever the scheme of colours changes. */
export const repainted = (paint) => scheme.addEventListener("change", paint);

/** The font of what is painted, at a size in pixels. */
export const font = (size) => `${size}px system-ui, "Segoe UI", "DejaVu Sans", sans-serif`;
