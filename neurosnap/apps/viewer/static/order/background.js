// What lies behind the nodes: the layers as stripes, and what ties equivalent sensors
// together.

import { font } from "../base/palette.js";

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
  const single = [...places.values()].filter(({ item }) => item.kind === "sensor");
  return Map.groupBy(single, ({ item }) => item.class).values();
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
