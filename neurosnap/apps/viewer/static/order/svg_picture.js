// A picture of the order that is kept: all that is laid out, at the size its names are
// read at, as an SVG file.

import { NodePainter } from "./nodes.js";
import { paintLines, paintNodes, paintWave } from "./painting.js";

const MARGIN = 28; // the layers' numbers stand in it

/** Save the picture of a diagram as a file. */
export function saveSvg({ scene, box }, what, name) {
  const file = new Blob([asSvg(scene, box, `Learned order of ${what}`)], { type: "image/svg+xml" });
  const address = URL.createObjectURL(file);
  Object.assign(document.createElement("a"), { href: address, download: name }).click();
  URL.revokeObjectURL(address);
}

/** The picture as the text of an SVG file. */
function asSvg(scene, box, title) {
  const { width, height, camera } = around(box);
  const context = new SvgContext(width, height);
  paintAll(context, scene, { camera, width, height, dots: 1, painter: new NodePainter() });
  return context.file(title);
}

function paintAll(context, scene, sheet) {
  context.fillStyle = sheet.painter.colours.panel;
  context.fillRect(0, 0, sheet.width * sheet.dots, sheet.height * sheet.dots);
  paintLines(context, scene, sheet);
  paintNodes(context, scene, sheet);
  paintWave(context, scene, sheet);
}

function around({ left, right, top, bottom }) {
  return {
    width: right - left + 2 * MARGIN,
    height: bottom - top + 2 * MARGIN,
    camera: { scale: 1, left: MARGIN - left, top: MARGIN - top },
  };
}

// Draws as a canvas does, into an SVG file. It knows the calls that the diagram paints
// with, and no others. (Libraries that do this set style attributes to read a font, which
// the page's content security policy forbids.)

const ESCAPES = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };
const escaped = (text) => text.replace(/[&<>"]/g, (letter) => ESCAPES[letter]);
const rounded = (value) => String(Math.round(value * 100) / 100);
const ANCHORS = { left: "start", center: "middle", right: "end", start: "start", end: "end" };
const STATE = [
  "fillStyle", "strokeStyle", "lineWidth", "globalAlpha", "font", "textAlign", "textBaseline",
];

/** The hatching or other tile that an area is filled with. */
class Tile {
  constructor(id) {
    this.id = id;
  }
}

/** What a canvas's context is for pixels. A path is painted where it was begun. */
class SvgContext {
  /** @param {number} width @param {number} height of the picture */
  constructor(width, height) {
    [this.width, this.height] = [width, height];
    Object.assign(this, { fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, globalAlpha: 1 });
    Object.assign(this, { font: "10px sans-serif", textAlign: "start", textBaseline: "alphabetic" });
    this.canvas = this; // what is made of a context can be made of its canvas
    this._marks = [];
    this._tiles = [];
    this._path = "";
    this._dash = [];
    this._at = new DOMMatrix();
    this._saved = [];
    this._measuring = document.createElement("canvas").getContext("2d");
  }

  /** The file. @param {string} title what it shows */
  file(title) {
    const [wide, high] = [rounded(this.width), rounded(this.height)];
    return [
      `<svg xmlns="http://www.w3.org/2000/svg" width="${wide}" height="${high}" viewBox="0 0 ${wide} ${high}">`,
      `<title>${escaped(title)}</title>`,
      ...(this._tiles.length ? ["<defs>", ...this._tiles, "</defs>"] : []),
      ...this._marks,
      "</svg>",
      "",
    ].join("\n");
  }

  // Where -------------------------------------------------------------------------------

  setTransform(...parts) {
    this._at = new DOMMatrix(parts);
  }

  translate(x, y) {
    this._at.translateSelf(x, y);
  }

  rotate(angle) {
    this._at.rotateSelf((180 * angle) / Math.PI);
  }

  save() {
    const state = Object.fromEntries(STATE.map((name) => [name, this[name]]));
    this._saved.push([state, this._dash, DOMMatrix.fromMatrix(this._at)]);
  }

  restore() {
    const [state, dash, at] = this._saved.pop();
    Object.assign(this, state);
    [this._dash, this._at] = [dash, at];
  }

  // Paths -------------------------------------------------------------------------------

  beginPath() {
    this._path = "";
  }

  moveTo(x, y) {
    this._go("M", x, y);
  }

  lineTo(x, y) {
    this._go("L", x, y);
  }

  bezierCurveTo(...places) {
    this._go("C", ...places);
  }

  closePath() {
    this._go("Z");
  }

  rect(x, y, width, height) {
    this.roundRect(x, y, width, height, 0);
  }

  roundRect(x, y, width, height, round) {
    const [a, b, c, d] = Array.isArray(round) ? round : [round, round, round, round];
    const corner = (radius, toX, toY) => radius && this._go("A", radius, radius, 0, 0, 1, toX, toY);
    const [right, bottom] = [x + width, y + height];
    this._go("M", x + a, y);
    this._go("L", right - b, y);
    corner(b, right, y + b);
    this._go("L", right, bottom - c);
    corner(c, right - c, bottom);
    this._go("L", x + d, bottom);
    corner(d, x, bottom - d);
    this._go("L", x, y + a);
    corner(a, x + a, y);
    this._go("Z");
  }

  /** A whole circle. */
  arc(x, y, radius) {
    this.roundRect(x - radius, y - radius, 2 * radius, 2 * radius, radius);
  }

  setLineDash(dash) {
    this._dash = dash;
  }

  fill() {
    this._mark("path", { d: this._path, fill: this._ink(this.fillStyle) });
  }

  stroke() {
    this._mark("path", {
      d: this._path,
      fill: "none",
      stroke: this._ink(this.strokeStyle),
      "stroke-width": rounded(this.lineWidth),
      ...(this._dash.length ? { "stroke-dasharray": this._dash.join(" ") } : {}),
    });
  }

  fillRect(...box) {
    this._alone(() => this.rect(...box));
    this.fill();
  }

  strokeRect(...box) {
    this._alone(() => this.rect(...box));
    this.stroke();
  }

  // Text, and tiles ---------------------------------------------------------------------

  fillText(text, x, y) {
    const attributes = {
      x: rounded(x),
      y: rounded(y + this._down()),
      style: `font:${this.font}`,
      "text-anchor": ANCHORS[this.textAlign],
      fill: this._ink(this.fillStyle),
    };
    this._mark("text", attributes, escaped(text));
  }

  measureText(text) {
    this._measuring.font = this.font;
    return this._measuring.measureText(text);
  }

  /** How far the letters' own baseline is below: few programs know any other. */
  _down() {
    const ascent = (baseline) => {
      this._measuring.font = this.font;
      this._measuring.textBaseline = baseline;
      return this._measuring.measureText("x").fontBoundingBoxAscent;
    };
    return ascent("alphabetic") - ascent(this.textBaseline);
  }

  /** A context to draw a tile with. */
  newTile(size) {
    return new SvgContext(size, size);
  }

  createPattern(tile) {
    const id = `tile-${this._tiles.length + 1}`;
    const [wide, high] = [tile.width, tile.height].map(rounded);
    const units = `patternUnits="userSpaceOnUse"`;
    this._tiles.push(
      `<pattern id="${id}" ${units} width="${wide}" height="${high}">`,
      ...tile._marks,
      "</pattern>",
    );
    return new Tile(id);
  }

  // -------------------------------------------------------------------------------------

  _go(letter, ...numbers) {
    this._path += letter + numbers.map(rounded).join(" ");
  }

  _alone(draw) {
    this.beginPath();
    draw();
  }

  _ink(style) {
    return style instanceof Tile ? `url(#${style.id})` : style;
  }

  _mark(tag, attributes, text = "") {
    const { a, b, c, d, e, f } = this._at;
    const all = { ...attributes };
    if (!this._at.isIdentity) all.transform = `matrix(${[a, b, c, d, e, f].map(fine).join(" ")})`;
    if (this.globalAlpha < 1) all.opacity = rounded(this.globalAlpha);
    const words = Object.entries(all).map(([name, value]) => ` ${name}="${escaped(value)}"`);
    this._marks.push(`<${tag}${words.join("")}${text ? `>${text}</${tag}>` : "/>"}`);
  }
}

const fine = (value) => String(Math.round(value * 1e4) / 1e4); // a turn needs more digits
