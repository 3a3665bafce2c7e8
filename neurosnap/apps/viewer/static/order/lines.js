// The lines between items: where they run, what they look like, and which is under the
// pointer. An excitatory line ends in an arrow, an inhibitory one is dashed and ends in
// a bar.

import { font } from "../base/colours.js";
import { complementOf, isComplement } from "../base/literals.js";
import { HEIGHT } from "./layered_drawing.js";

/** How wide the part of an item is that stands for the complement. */
export const CAP = 16;

const FAINT = 0.08; // how much is seen of a link of what is not looked at
const PIECES = 16; // straight ones, that a curve is taken for

/** Where on an item a literal is. */
function anchor(place, literal) {
  return isComplement(literal) ? place.x + place.width / 2 - CAP / 2 : place.x - CAP / 2;
}

/** The curve of a link: its four control points. */
export function curve(link, places) {
  const [from, to] = [places.get(link.from.sensor), places.get(link.to.sensor)];
  const { source, target } = link.edge;
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
  context.globalAlpha = faint ? FAINT : strong ? 1 : 0.8;
  context.lineWidth = strong ? 2.4 : 1.1;
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

// Pulses between one hop of a wave and the next, on their way along the lines: round ones
// excite, square ones inhibit.

/** Return every way a pulse can go; an edge's contrapositive runs against its line. */
export function waysOf(links) {
  return links.flatMap((link) => {
    const { source, target } = link.edge;
    const against = { source: complementOf(target), target: complementOf(source) };
    return [{ link, source, target, back: false }, { link, ...against, back: true }];
  });
}

/** Paint the pulses that lead to what a wave reaches with its next hop. */
export function paintPulses(context, ways, curves, { hops, at }, colours) {
  const [now, gone] = [Math.floor(at), at % 1];
  context.lineWidth = 1.5;
  context.strokeStyle = colours["on-wave"];
  context.fillStyle = colours.wave;
  for (const { link, source, target, back } of ways) {
    if (hops.get(source) !== now || hops.get(target) !== now + 1) continue;
    const { x, y } = along(curves.get(link), back ? 1 - gone : gone);
    context.beginPath();
    if (isComplement(target)) context.rect(x - 4, y - 4, 8, 8);
    else context.arc(x, y, 4.5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
}

// What lies behind the nodes: the layers as stripes, and what ties equivalent sensors
// together.

const LEGIBLE = 9; // pixels a stripe has to have to be numbered

/** Paint the layers over the whole width, each with its number. */
export function paintStripes(context, bands, { scale, top }, width, colours) {
  context.font = font(10);
  context.textBaseline = "middle";
  bands.forEach((band, number) => {
    const [from, to] = [band.top * scale + top, band.bottom * scale + top];
    if (number % 2 === 0) {
      context.fillStyle = colours.band;
      context.fillRect(0, from, width, to - from);
    }
    if (to - from < LEGIBLE) return;
    context.fillStyle = colours.mute;
    context.fillText(String(band.layer), 5, (from + to) / 2);
  });
}

/** Paint a double line through the members of each class; crossed to a complement. */
export function paintClasses(context, places, colours) {
  context.strokeStyle = colours.mute;
  context.lineWidth = 1.3;
  for (const members of classes(places)) {
    // Along each row, and from one row to the next where they begin.
    members.sort((a, b) => a.y - b.y || a.x - b.x);
    let first = members[0];
    for (let k = 1; k < members.length; k += 1) {
      const [one, other] = [members[k - 1], members[k]];
      if (one.y === other.y) {
        tie(context, one, other);
      } else {
        tie(context, first, other);
        first = other;
      }
    }
  }
}

function classes(places) {
  return Map.groupBy(places.values(), ({ item }) => item.class).values();
}

function tie(context, one, other) {
  const [wide, high] = [other.x - one.x, other.y - one.y];
  const apart = 2.2 / Math.hypot(wide, high);
  const [across, down] = [high * apart, -wide * apart];
  for (const side of [-1, 1]) {
    context.beginPath();
    context.moveTo(one.x + side * across, one.y + side * down);
    context.lineTo(other.x + side * across, other.y + side * down);
    context.stroke();
  }
  if (one.item.turned !== other.item.turned) cross(context, one, other);
}

/** A stroke through a double line: one is equivalent to the complement of the other. */
function cross(context, one, other) {
  // In the middle of what is seen of it: the nodes lie above the line.
  const level = one.y === other.y;
  const shift = level ? (one.width - other.width) / 4 : 0;
  const [x, y] = [(one.x + other.x) / 2 + shift, (one.y + other.y) / 2];
  const [wide, high] = level ? [3, 7] : [7, 3];
  context.beginPath();
  context.moveTo(x - wide, y + high);
  context.lineTo(x + wide, y - high);
  context.stroke();
}
