// Elements, found and made.

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

/** Make an element of a drawing. */
export function shape(tag, attributes = {}) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/** Set an element's text, if it is another than before: setting it costs a layout. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
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
