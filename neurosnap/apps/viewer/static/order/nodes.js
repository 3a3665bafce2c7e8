// How an item looks. A sensor is a pill: its name stands for its own literal, the star
// at its end for the complement, and whichever the state holds is filled. Neither is
// where the state does not know: its end says "?", or "!" where it was contradicted. Filled
// is what is believed, and the rim is around what was read: what is only predicted has no
// rim and is hatched, and what was read and contradicted has a rim and is not filled.

import { font, palette } from "../base/colours.js";
import { HEIGHT } from "./layered_drawing.js";
import { CAP } from "./lines.js";
import { beliefs } from "../tick/belief.js";

const FONT = 11;
const LONGEST = 28; // characters of a name that are drawn
const RIM = 2.5; // around what was read
const READABLE = 0.5; // below this scale a name is only grey noise
const ROUND = HEIGHT / 2; // a sensor's corners

let measuring = null;

/** How wide an item is drawn. */
export function widthOf(item) {
  measuring ??= document.createElement("canvas").getContext("2d");
  measuring.font = font(FONT);
  return Math.round(measuring.measureText(shortened(item.name)).width + CAP + 18);
}

/** A name as it is drawn: of a very long one the beginning and the end tell it apart. */
function shortened(name) {
  const letters = [...name];
  if (letters.length <= LONGEST) return name;
  const half = (LONGEST - 1) >> 1;
  return `${letters.slice(0, half).join("")}…${letters.slice(-half).join("")}`;
}

/** Paint items; keeps the colours until they are renewed. */
export class NodePainter {
  constructor() {
    this.renew();
  }

  /** The colours have changed. */
  renew() {
    this.colours = palette();
    this._hatch = null; // it needs a canvas
  }

  /**
   * Paint an item where it stands.
   *
   * @param {import("./looks.js").Look} look
   */
  paint(context, place, look, scale) {
    if (look.dim) {
      // What lies behind does not shine through.
      outline(context, place.x - place.width / 2, place.y - HEIGHT / 2, place.width, ROUND);
      context.fillStyle = this.colours.panel;
      context.fill();
      context.globalAlpha = 0.4;
    }
    this._hatch ??= hatching(context, this.colours.accent);
    this._sensor(context, place, look, scale);
    context.globalAlpha = 1;
  }

  _sensor(context, place, look, scale) {
    const { colours } = this;
    const [left, top, width] = [place.x - place.width / 2, place.y - HEIGHT / 2, place.width];
    const inner = width - CAP;
    const own = this._fill(look, "on", look.own);
    const cap = this._cap(look);
    outline(context, left, top, width, ROUND);
    context.fillStyle = colours.panel;
    context.fill();
    if (own) this._half(context, own, left, top, inner, [ROUND, 0, 0, ROUND]);
    if (cap) this._half(context, cap, left + inner, top, CAP, [0, ROUND, ROUND, 0]);
    context.fillStyle = colours.line;
    context.fillRect(left + inner - 0.5, top + 1, 1, HEIGHT - 2);
    this._border(context, look, left, top, width);
    if (scale < READABLE) return;
    const [name, mark] = [shortened(place.item.name), sign(look.condition)];
    this._text(context, name, left + inner / 2 + 3, place.y, own?.ink ?? colours.ink);
    this._text(context, mark, left + inner + CAP / 2 - 2, place.y, cap?.ink ?? colours.mute);
  }

  _cap(look) {
    const { colours } = this;
    if (look.condition !== "contradicted") {
      return this._fill(look, "off", look.complement);
    }
    return { paper: colours.bad, ink: colours["on-accent"], front: look.complement === 2 };
  }

  /** What a half is filled with: the wave, and while there is one only faintly the state. */
  _fill({ condition, predicted, waving }, half, wave) {
    const { colours } = this;
    const held = condition === half;
    if (wave > 0) return { paper: colours.wave, ink: colours["on-wave"], front: wave === 2 };
    if (held && predicted && !waving) {
      return { paper: this._hatch, ink: colours.ink, front: false };
    }
    if (held && waving) return { paper: colours.line, ink: colours.ink, front: false };
    if (held) return { paper: colours.accent, ink: colours["on-accent"], front: false };
    return null;
  }

  /** It has corners of its own: a clip for each of hundreds of nodes is slow. */
  _half(context, fill, left, top, width, corners) {
    outline(context, left, top, width, corners);
    context.fillStyle = fill.paper;
    context.fill();
    if (!fill.front) return;
    context.fillStyle = fill.ink; // what was reached last is underlined
    context.fillRect(left + 5, top + HEIGHT - 4, width - 10, 2);
  }

  _border(context, look, left, top, width) {
    const contradicted = look.condition === "contradicted";
    outline(context, left, top, width, ROUND);
    context.lineWidth = contradicted ? 2 : 1.2;
    context.strokeStyle = contradicted ? this.colours.bad : this.colours.mute;
    context.setLineDash(look.condition === "unknown" || look.predicted ? [3, 3] : []);
    context.stroke();
    context.setLineDash([]);
    if (look.reads !== null && !look.waving) this._rim(context, look, left, top, width);
    this._ring(context, look, left, top, width);
  }

  /** Surround the half that was read, whatever is believed. */
  _rim(context, { reads }, left, top, width) {
    const [x, wide] = reads ? [left, width - CAP] : [left + width - CAP, CAP];
    const [inset, corner] = [RIM / 2, ROUND - RIM / 2];
    const corners = reads ? [corner, 0, 0, corner] : [0, corner, corner, 0];
    outline(context, x + inset, top + inset, wide - RIM, corners, HEIGHT - RIM);
    context.lineWidth = RIM;
    context.strokeStyle = this.colours.accent;
    context.stroke();
  }

  _ring(context, look, left, top, width) {
    if (!look.chosen && !look.found) return;
    outline(context, left - 3.5, top - 3.5, width + 7, ROUND + 3.5, HEIGHT + 7);
    context.lineWidth = look.chosen ? 2.5 : 1.5;
    context.strokeStyle = look.chosen ? this.colours.ink : this.colours.accent;
    context.stroke();
  }

  _text(context, text, x, y, colour) {
    context.font = font(FONT);
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = colour;
    context.fillText(text, x, y + 0.5);
  }
}

const SIGNS = { contradicted: "!", unknown: "?" };
const sign = (condition) => SIGNS[condition] ?? "∗";

function outline(context, left, top, width, round, height = HEIGHT) {
  context.beginPath();
  context.roundRect(left, top, width, height, round);
}

// How each item looks at a tick: what the state has of it, how far the wave has come, and
// whether it is selected or found.

/**
 * @typedef {object} Look
 * @property {string} condition on, off, unknown or contradicted
 * @property {boolean} predicted the state has it, and it was not read
 * @property {number|null} reads what was read of it
 * @property {number} own how the wave stands to the sensor's own literal: 0 has not
 *   reached it, 1 has, 2 has at this very hop
 * @property {number} complement the same for its complement
 * @property {boolean} waving a wave is shown
 * @property {boolean} chosen it is selected
 * @property {boolean} found the search found it
 * @property {boolean} dim there is a search, and it did not find it, or something else is
 *   looked at
 */

/** Something that is the same for looks that are the same. */
export const lookKey = (look) => Object.values(look).join();

/**
 * Return what gives each item its look.
 *
 * @param {object} frame
 * @param {{hops: Map<number, number>, at: number}|null} wave
 * @param {{sensor: number}|null} chosen
 * @param {Set<number>|null} sought the sensors a search has found; null: there is none
 * @param {Set<number>|null} seen the sensors that are looked at; null: all
 */
export function looks(frame, wave, chosen, sought, seen = null) {
  const held = beliefs(frame);
  const reached = reach(wave);
  return ({ sensor }) => {
    const found = sought?.has(sensor) ?? false;
    return {
      ...held[sensor],
      own: reached(2 * sensor),
      complement: reached(2 * sensor + 1),
      waving: wave !== null,
      chosen: chosen?.sensor === sensor,
      found,
      dim: (sought !== null && !found) || (seen !== null && !seen.has(sensor)),
    };
  };
}

function reach(wave) {
  if (wave === null) return () => 0;
  const now = Math.floor(wave.at);
  return (literal) => {
    const hop = wave.hops.get(literal);
    if (hop === undefined || hop > now) return 0;
    return hop === now ? 2 : 1;
  };
}

// The hatching of what is predicted: stripes in a colour, as wide at every scale.

const SIZE = 6; // pixels until the stripes repeat

/** Make a pattern of stripes to fill with. */
function hatching(context, colour) {
  const tile = context.newTile?.(SIZE) ?? canvasTile(); // an SVG has tiles of its own
  tile.strokeStyle = colour;
  tile.globalAlpha = 0.45;
  tile.lineWidth = 1.8;
  tile.beginPath();
  for (const shift of [-SIZE, 0, SIZE]) {
    tile.moveTo(shift, SIZE);
    tile.lineTo(shift + SIZE, 0);
  }
  tile.stroke();
  return context.createPattern(tile.canvas, "repeat");
}

function canvasTile() {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [SIZE, SIZE];
  return canvas.getContext("2d");
}
