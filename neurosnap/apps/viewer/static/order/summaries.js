// How a summary looks, an item that stands for several sensors: its name, how many of them
// are predicted, contradicted and unknown, and along its edges which part is on and which
// part the wave has reached.

import { HEIGHT } from "./layout.js";
import { font } from "../base/palette.js";

const LARGE = 15; // an order that has summaries is drawn small
const SMALL = 13;
const BETWEEN = 8; // before each count
const BOX = 9; // of hatching, before how many are predicted
const SIGNS = [["contradicted", "!"], ["predicted", ""], ["unknown", "?"]];

export const SQUARE = 4; // corners

/** How wide a summary is drawn; `measure` gives the width of a text in a font. */
export function summaryWidth(item, measure) {
  const most = String(item.sensors.length);
  const counts = measure(most.repeat(SIGNS.length) + "!?", font(SMALL));
  return Math.round(measure(`+ ${item.name}`, font(LARGE)) + counts + 3 * BETWEEN + BOX + 20);
}

/** Paint along the edges of a summary which part of it is what. */
export function paintSummary(context, { item, width }, look, left, top, colours, hatch) {
  const { counts } = look;
  const part = (width - 2) / item.sensors.length;
  let from = left + 1;
  const strip = (count, ink) => {
    context.fillStyle = ink;
    context.fillRect(from, top + HEIGHT - 4, part * count, 3);
    from += part * count;
  };
  strip(counts.on, colours.accent);
  strip(counts.predicted, hatch);
  strip(counts.contradicted, colours.bad);
  context.fillStyle = colours.wave;
  context.fillRect(left + 1, top + 1, part * look.touched, 3);
}

/** Write on it what it is, and how many of its sensors are what. */
export function writeSummary(context, { item, y }, { counts }, left, colours, hatch) {
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.font = font(LARGE);
  context.fillStyle = colours.ink;
  const name = `+ ${item.name}`;
  context.fillText(name, left + 10, y + 0.5);
  let x = left + 10 + context.measureText(name).width;
  context.font = font(SMALL);
  for (const [kind, sign] of SIGNS) {
    if (counts[kind] === 0) continue;
    x += BETWEEN;
    if (kind === "predicted") {
      context.fillStyle = hatch;
      context.fillRect(x, y - BOX / 2, BOX, BOX);
      context.strokeStyle = colours.accent;
      context.lineWidth = 1;
      context.strokeRect(x, y - BOX / 2, BOX, BOX);
      x += BOX + 2;
    }
    context.fillStyle = kind === "contradicted" ? colours.bad : colours.ink;
    const text = `${sign}${counts[kind]}`;
    context.fillText(text, x, y + 0.5);
    x += context.measureText(text).width;
  }
}
