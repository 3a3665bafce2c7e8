// How an item looks. A sensor is a pill: its name stands for its own literal, the star
// at its end for the complement, and whichever the state holds is filled. Neither is
// where the state does not know: its end says "?", or "!" where it was contradicted.

import { HEIGHT } from "./layout.js";
import { CAP } from "./links.js";
import { palette, font } from "./palette.js";

const FONT = 11;
const LARGE = 15; // of summaries: an order that has some is drawn small
const READABLE = 0.5; // below this scale a name is only grey noise
const ROUND = HEIGHT / 2; // a sensor's corners
const SQUARE = 4; // a summary's

let measuring = null;

/** How wide an item is drawn. */
export function widthOf(item) {
  measuring ??= document.createElement("canvas").getContext("2d");
  const single = item.kind === "sensor";
  measuring.font = font(single ? FONT : LARGE);
  const text = measuring.measureText(item.name).width;
  return Math.round(text + (single ? CAP + 18 : 38));
}

/** Paint items; keeps the colours until they are renewed. */
export class NodePainter {
  constructor() {
    this.renew();
  }

  /** The colours have changed. */
  renew() {
    this.colours = palette();
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
    if (place.item.kind === "sensor") this._sensor(context, place, look, scale);
    else this._summary(context, place, look, scale);
    context.globalAlpha = 1;
  }

  _sensor(context, place, look, scale) {
    const { colours } = this;
    const [left, top, width] = [place.x - place.width / 2, place.y - HEIGHT / 2, place.width];
    const inner = width - CAP;
    const own = this._fill(look.condition === "on", look.own, look.waving);
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
    const [name, mark] = [place.item.name, sign(look.condition)];
    this._text(context, name, left + inner / 2 + 3, place.y, own?.ink ?? colours.ink);
    this._text(context, mark, left + inner + CAP / 2 - 2, place.y, cap?.ink ?? colours.mute);
  }

  _cap(look) {
    const { colours } = this;
    if (look.condition !== "contradicted") {
      return this._fill(look.condition === "off", look.complement, look.waving);
    }
    return { paper: colours.bad, ink: colours["on-accent"], front: look.complement === 2 };
  }

  /** What a half is filled with: the wave, and while there is one only faintly the state. */
  _fill(held, wave, waving) {
    const { colours } = this;
    if (wave > 0) return { paper: colours.wave, ink: colours["on-wave"], front: wave === 2 };
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
    context.setLineDash(look.condition === "unknown" ? [3, 3] : []);
    context.stroke();
    context.setLineDash([]);
    this._ring(context, look, left, top, width, ROUND);
  }

  _summary(context, place, look, scale) {
    const { colours } = this;
    const [left, top, width] = [place.x - place.width / 2, place.y - HEIGHT / 2, place.width];
    const part = (width - 2) / place.item.sensors.length;
    context.fillStyle = colours.panel;
    context.strokeStyle = colours.mute;
    context.lineWidth = 1.2;
    for (const shift of [3, 0]) {
      outline(context, left + shift, top - shift, width, SQUARE);
      context.fill();
      context.stroke();
    }
    // Of its sensors, how many are on, and how many the wave has reached.
    const [on, reached] = look.share;
    context.fillStyle = colours.accent;
    context.fillRect(left + 1, top + HEIGHT - 4, part * on, 3);
    context.fillStyle = colours.wave;
    context.fillRect(left + 1, top + 1, part * reached, 3);
    this._ring(context, look, left, top, width, SQUARE);
    if (scale < READABLE * 0.7) return;
    this._text(context, `+ ${place.item.name}`, place.x, place.y, colours.ink, LARGE);
  }

  _ring(context, look, left, top, width, round) {
    if (!look.chosen && !look.found) return;
    outline(context, left - 3.5, top - 3.5, width + 7, round + 3.5, HEIGHT + 7);
    context.lineWidth = look.chosen ? 2.5 : 1.5;
    context.strokeStyle = look.chosen ? this.colours.ink : this.colours.accent;
    context.stroke();
  }

  _text(context, text, x, y, colour, size = FONT) {
    context.font = font(size);
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
