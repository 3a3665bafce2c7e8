// The lines between items: where they run, what they look like, and which is under the
// pointer. An excitatory line ends in an arrow, an inhibitory one is dashed and ends in
// a bar.

import { HEIGHT } from "./layout.js";
import { isComplement } from "../base/literals.js";

/** How wide the part of an item is that stands for the complement. */
export const CAP = 16;

const FAINT = 0.08; // how much is seen of a link of what is not looked at
const PIECES = 16; // straight ones, that a curve is taken for

/** Where on an item a literal is. */
function anchor(place, literal) {
  if (place.item.kind !== "sensor") return place.x;
  return isComplement(literal) ? place.x + place.width / 2 - CAP / 2 : place.x - CAP / 2;
}

/** The curve of a link: its four control points. */
export function curve(link, places) {
  const [from, to] = [places.get(link.from.key), places.get(link.to.key)];
  const { source, target } = link.edges[0];
  const [x0, x3] = [anchor(from, source), anchor(to, target)];
  // A line within a row leaves it upwards, and comes back from there.
  const level = from.y === to.y;
  const up = level || to.y < from.y;
  const half = HEIGHT / 2;
  const y0 = from.y + (up ? -half : half);
  const y3 = to.y + (up && !level ? half : -half);
  const bend = level ? Math.min(14 + Math.abs(x3 - x0) / 14, 40) : Math.abs(y3 - y0) * 0.4;
  const out = up ? -bend : bend;
  return { x0, y0, x1: x0, y1: y0 + out, x2: x3, y2: level ? y3 - bend : y3 - out, x3, y3 };
}

/** A place on a curve, `t` of the way along. */
export function along(c, t) {
  const s = 1 - t;
  const [a, b, d, e] = [s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t];
  return {
    x: a * c.x0 + b * c.x1 + d * c.x2 + e * c.x3,
    y: a * c.y0 + b * c.y1 + d * c.y2 + e * c.y3,
  };
}

/** Paint a link along its curve. */
export function paintLink(context, link, c, colours, strong, faint = false) {
  const colour = colours[link.kind];
  context.strokeStyle = colour;
  context.fillStyle = colour;
  // Lines between summaries are many, and each is less certain to matter.
  const summary = link.from.kind === "layer" || link.to.kind === "layer";
  context.globalAlpha = faint ? FAINT : strong ? 1 : summary ? 0.3 : 0.8;
  context.lineWidth = (strong ? 2.4 : 1.1) + Math.log2(link.edges.length) / 6;
  context.setLineDash(link.kind === "inhibit" ? [5, 3] : []);
  context.beginPath();
  context.moveTo(c.x0, c.y0);
  context.bezierCurveTo(c.x1, c.y1, c.x2, c.y2, c.x3, c.y3);
  context.stroke();
  context.setLineDash([]);
  paintEnd(context, link.kind, c);
  context.globalAlpha = 1;
}

function paintEnd(context, kind, c) {
  const back = along(c, 0.93);
  const angle = Math.atan2(c.y3 - back.y, c.x3 - back.x);
  context.save();
  context.translate(c.x3, c.y3);
  context.rotate(angle);
  context.beginPath();
  if (kind === "excite") {
    context.moveTo(0, 0);
    context.lineTo(-8, -3.6);
    context.lineTo(-8, 3.6);
    context.closePath();
    context.fill();
  } else {
    context.lineWidth = 2.4;
    context.moveTo(-2, -5);
    context.lineTo(-2, 5);
    context.stroke();
  }
  context.restore();
}

/** How far a place is from a curve. */
export function distance(c, { x, y }) {
  let [least, at] = [Infinity, along(c, 0)];
  for (let k = 1; k <= PIECES; k += 1) {
    const next = along(c, k / PIECES);
    const [dx, dy] = [next.x - at.x, next.y - at.y];
    const length = dx * dx + dy * dy || 1;
    const t = Math.min(Math.max(((x - at.x) * dx + (y - at.y) * dy) / length, 0), 1);
    least = Math.min(least, Math.hypot(x - at.x - t * dx, y - at.y - t * dy));
    at = next;
  }
  return least;
}
