// How an item looks. A sensor is a pill: its name stands for its own literal, the star
// at its end for the complement, and whichever the state holds is filled. Neither is
// where the state does not know: its end says "?", or "!" where it was contradicted. Filled
// is what is believed, and the rim is around what was read: what is only predicted has no
// rim and is hatched, and what was read and contradicted has a rim and is not filled.

import { hatching } from "./hatch.js";
import { HEIGHT } from "./layout.js";
import { CAP } from "./links.js";
import { palette, font } from "../base/palette.js";
import { paintSummary, SQUARE, summaryWidth, writeSummary } from "./summaries.js";

const FONT = 11;
const LONGEST = 28; // characters of a name that are drawn
const RIM = 2.5; // around what was read
const READABLE = 0.5; // below this scale a name is only grey noise
const ROUND = HEIGHT / 2; // a sensor's corners

let measuring = null;

/** How wide an item is drawn. */
export function widthOf(item) {
  measuring ??= document.createElement("canvas").getContext("2d");
  const measure = (text, style) => {
    measuring.font = style;
    return measuring.measureText(text).width;
  };
  if (item.kind !== "sensor") return summaryWidth(item, measure);
  return Math.round(measure(shortened(item.name), font(FONT)) + CAP + 18);
}

/** A name as it is drawn: of a very long one the beginning and the end tell it apart. */
export function shortened(name) {
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
    if (place.item.kind === "sensor") this._sensor(context, place, look, scale);
    else this._summary(context, place, look, scale);
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
    this._ring(context, look, left, top, width, ROUND);
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

  _summary(context, place, look, scale) {
    const { colours } = this;
    const [left, top, width] = [place.x - place.width / 2, place.y - HEIGHT / 2, place.width];
    context.fillStyle = colours.panel;
    const isSound = look.counts.contradicted === 0;
    context.strokeStyle = isSound ? colours.mute : colours.bad;
    context.lineWidth = isSound ? 1.2 : 2;
    for (const shift of [3, 0]) {
      outline(context, left + shift, top - shift, width, SQUARE);
      context.fill();
      context.stroke();
    }
    paintSummary(context, place, look, left, top, colours, this._hatch);
    this._ring(context, look, left, top, width, SQUARE);
    if (scale < READABLE * 0.7) return;
    writeSummary(context, place, look, left, colours, this._hatch);
  }

  _ring(context, look, left, top, width, round) {
    if (!look.chosen && !look.found) return;
    outline(context, left - 3.5, top - 3.5, width + 7, round + 3.5, HEIGHT + 7);
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
