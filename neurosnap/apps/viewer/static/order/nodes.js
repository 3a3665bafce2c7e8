// The appearance of a sensor: a pill that shows its state and its reading.
// Its name stands for its own literal, the sign at its end for the complement, and
// whichever the state holds is filled. Neither is where the state does
// not know: its end says "?", or "!" where it was contradicted. Filled is what is believed, and
// the rim is around what was read: what is only predicted has no rim and is hatched, and what
// was read and contradicted has a rim and is not filled. The style sheet has the colours.

import { font, make, shape, write } from "../base/dom.js";
import { shortened } from "../base/literals.js";
import { beliefs } from "../tick/belief.js";
import { HEIGHT } from "./layered_drawing.js";

/** How wide the part of a pill is that stands for the complement. */
export const CAP = 16;

const [ROUND, NAME] = [HEIGHT / 2, 13]; // the style sheet says 13, too

let measuring = null;

/** How wide an item is drawn. */
export function widthOf(item) {
  measuring ??= make("canvas").getContext("2d");
  measuring.font = font(NAME);
  return Math.round(measuring.measureText(shortened(item.name)).width + CAP + 12);
}

/** The shape of the left (-1) or the right (1) half of a pill, from where the halves meet. */
function half(side, at, wide) {
  return `M${at} ${-ROUND}H${at + side * (wide - ROUND)}a${ROUND} ${ROUND} 0 0 ${side > 0 ? 1 : 0} 0 ${2 * ROUND}H${at}z`;
}

/** The pill of an item where it stands, if it can be that from before; `dress` gives it its colours. */
export function nodeOf({ x, y, width, item }, before) {
  const key = `${width} ${item.name}`;
  const node = before?.dataset.key === key ? before : pillOf(width, item, key);
  const at = `translate(${x} ${y})`;
  if (node.getAttribute("transform") !== at) node.setAttribute("transform", at);
  return node;
}

// Of few elements, and only the whole is moved: the browser paints whatever has a transform or
// an opacity by itself, at each frame.
function pillOf(width, item, key) {
  const left = -width / 2;
  const middle = width / 2 - CAP; // between the two halves
  const pill = (out, name) => {
    const [wide, high] = [width + 2 * out, HEIGHT + 2 * out];
    return shape("rect", { class: name, x: left - out, y: -high / 2, width: wide, height: high, rx: high / 2 });
  };
  const text = (name, at, words) => {
    const made = shape("text", { class: name, x: at, y: 0.5 });
    made.textContent = words;
    return made;
  };
  const node = shape("g", { "data-sensor": item.sensor, "data-key": key });
  node.append(
    pill(0.6, "border"),
    shape("path", { class: "half own", d: half(-1, middle, width - CAP) }),
    shape("path", { class: "half cap", d: half(1, middle, CAP) }),
    pill(3.5, "ring"),
    text("name own", left / 2 + middle / 2 + 1, shortened(item.name)),
    text("sign cap", middle + CAP / 2 - 2, ""),
  );
  return node;
}

const SIGNS = { contradicted: "!", unknown: "?" };

/** Give a node a look, if it is another than before. */
export function dress(node, look) {
  if (node.getAttribute("class") === look) return;
  node.setAttribute("class", look);
  write(node.lastChild, SIGNS[look.split(" ")[1]] ?? "∗");
}

/**
 * Return what gives each item its look, as the classes of its node: what the state has of it,
 * how far the wave has come, and whether it is selected, found or looked at.
 *
 * @param {object} frame
 * @param {{hops: Map<number, number>, at: number}|null} wave
 * @param {{sensor: number}|null} chosen
 * @param {Set<number>|null} sought the sensors a search has found; null: there is none
 * @param {Set<number>|null} seen the sensors that are looked at; null: all
 */
export function looks(frame, wave, chosen, sought, seen) {
  const held = beliefs(frame);
  const reached = (name, literal) => {
    const hop = wave?.hops.get(literal) ?? Infinity;
    const now = Math.floor(wave?.at ?? -1);
    return hop > now ? "" : `reached-${name}${hop === now ? ` last-${name}` : ""}`;
  };
  return ({ sensor }) => {
    const { condition, predicted, reads } = held[sensor];
    const isFound = sought?.has(sensor) ?? false;
    const isDim = (sought !== null && !isFound) || (seen !== null && !seen.has(sensor));
    return [
      "node",
      condition,
      predicted && "predicted",
      wave && "waving",
      reached("own", 2 * sensor),
      reached("cap", 2 * sensor + 1),
      reads !== null && !wave && (reads ? "reads-on" : "reads-off"),
      chosen?.sensor === sensor && "chosen",
      isFound && "found",
      isDim && "dim",
    ]
      .filter(Boolean)
      .join(" ");
  };
}
