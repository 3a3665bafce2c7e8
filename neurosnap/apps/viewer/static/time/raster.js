// A raster of every sensor over time: a row a sensor, a column a tick.

import { ask, gathering } from "../base/api.js";
import { counted, find, make, palette, repainted, write } from "../base/dom.js";
import { shortened } from "../base/literals.js";
import { term } from "../base/terms.js";

const HIGH = 13; // pixels of a row
const NAMES = 170; // pixels of the names
const SENSORS = 200; // rows at a time
// As the server numbers them.
const WORDS = [
  "not recorded", "unknown", "off", "on", "off, predicted", "on, predicted",
  "contradicted",
];
const INKS = ["bg", "line", "panel", "accent", "guess", "predicted", "bad"];

/** The tab. */
export class RasterView {
  /**
   * @param {string[]} names
   * @param {object} on
   * @param {(tick: number) => void} on.seek
   * @param {(sensor: number) => void} on.pick
   */
  constructor(names, on) {
    this._names = names;
    this._on = on;
    this._range = [1, 0];
    this._frame = null;
    this._gather = gathering(() => this._ask());
    this._findings = []; // a frame is around what each sensor read
    this._cursor = null; // the square that the keys are at: `{tick, sensor}`
    this._canvas = make("canvas", { tabIndex: 0, role: "img" });
    this._now = make("i", { className: "now" });
    this._at = make("i", { className: "at", hidden: true });
    this._says = make("p", { className: "quiet", ariaLive: "polite" });
    this._part = make("select", { ariaLabel: "Which sensors are shown", hidden: true });
    const key = make("ul", { className: "key", ariaLabel: "What the colours mean" });
    for (const value of [3, 2, 5, 4, 6, 1]) {
      const swatch = make("i", { className: `swatch ${INKS[value]}` });
      const words = WORDS[value].includes("predicted") ? term("predicted", WORDS[value]) : WORDS[value];
      key.append(make("li", {}, swatch, words));
    }
    const bar = make("div", { className: "bar" }, this._part, key, this._says);
    this._map = make("div", { className: "map" }, this._canvas, this._now, this._at);
    find("raster").replaceChildren(bar, this._map);
    this._part.addEventListener("change", () => this._load());
    this._canvas.addEventListener("pointermove", (event) => this._tell(this._under(event)));
    this._canvas.addEventListener("pointerleave", () => this._tell(this._cursor));
    this._canvas.addEventListener("click", (event) => this._go(this._under(event)));
    this._canvas.addEventListener("keydown", (event) => this._key(event));
    new ResizeObserver(() => this._resized()).observe(this._map);
    repainted(() => this._draw());
  }

  /** Show ticks `first` to `last`. */
  load(first, last) {
    this._range = [first, last];
    this._load();
  }

  /** A tick is shown. */
  at(frame) {
    const was = this._frame;
    this._frame = frame;
    const parts = Math.ceil(frame.sensors / SENSORS);
    if (this._part.options.length !== parts) this._offer(frame.sensors);
    this._place();
    if (was === null) this._load();
  }

  /** The tab has come up. */
  open() {
    this._load();
  }

  /** Put a frame around what the sensors at fault read. */
  mark(findings) {
    this._findings = findings;
    this._draw();
  }

  _offer(sensors) {
    const starts = Array.from({ length: Math.ceil(sensors / SENSORS) }, (_, k) => k * SENSORS);
    const text = (start) => `sensors ${start + 1} to ${Math.min(start + SENSORS, sensors)}`;
    const chosen = this._part.value;
    this._part.replaceChildren(
      ...starts.map((start) => make("option", { value: start }, text(start))),
    );
    if (chosen) this._part.value = chosen;
    this._part.hidden = starts.length < 2;
  }

  /** Ask for the values until all of them have been read; nothing while they are not seen. */
  _load() {
    this._gather().catch(() => {}); // said where it was asked
  }

  async _ask() {
    const isSeen = !find("raster").hidden && this._frame !== null;
    if (!isSeen || this._range[1] < this._range[0]) return true;
    const [from, to] = this._range;
    this._askedFor = this._map.clientWidth;
    const columns = Math.min(2000, Math.max(1, this._askedFor - NAMES));
    const sensor = Number(this._part.value || 0);
    this._known = await ask("raster", { from, to, columns, sensor, sensors: SENSORS });
    this._draw();
    return this._known.done;
  }

  _resized() {
    if (this._map.clientWidth !== this._askedFor) this._load();
  }

  _draw() {
    if (!this._known || this._map.clientWidth === 0) return;
    this._width = this._map.clientWidth;
    const { sensor, sensors, columns, step, first } = this._known;
    const rows = Math.max(0, Math.min(sensors, this._frame.sensors - sensor)); // others are still to be grown
    const [wide, high] = [this._width, rows * HIGH];
    const dots = devicePixelRatio;
    const canvas = this._canvas;
    [canvas.width, canvas.height] = [wide * dots, high * dots];
    [canvas.style.width, canvas.style.height] = [`${wide}px`, `${high}px`];
    if (rows === 0 || columns === 0) return;
    const colours = palette();
    const context = canvas.getContext("2d");
    context.scale(dots, dots);
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.fillStyle = colours.ink;
    for (let row = 0; row < rows; row += 1) {
      context.fillText(shortened(this._names[sensor + row]), 2, (row + 0.5) * HIGH, NAMES - 8);
    }
    context.imageSmoothingEnabled = false; // a square is a square
    this._bytes = bytes(this._known.values);
    const image = imageOf(colours, this._bytes, columns, rows, sensors);
    context.drawImage(image, NAMES, 0, wide - NAMES, high);
    const last = first + (columns - 1) * step;
    const few = step > 1 ? `, one of ${step} ticks` : "";
    canvas.ariaLabel = `${counted(rows, "sensor")} over ticks ${first} to ${last}${few}. Arrows move, Enter goes there.`;
    this._shown = { sensor, sensors, columns, step, first, rows };
    context.strokeStyle = colours.bad;
    context.lineWidth = 2;
    for (const { sensors: [culprit], first: from, last: to } of this._findings) {
      const ends = [from, (to ?? Infinity) + 1].map((tick) => Math.min(Math.max(this._begin(tick), NAMES), wide));
      const isShown = culprit >= sensor && culprit < sensor + rows && ends[0] < ends[1];
      if (isShown) context.strokeRect(ends[0] - 2, (culprit - sensor) * HIGH, ends[1] - ends[0] + 4, HIGH);
    }
    this._place();
  }

  /** Where a tick begins. */
  _begin(tick) {
    const { first, step, columns } = this._shown;
    return NAMES + ((tick - first) / (step * columns)) * (this._width - NAMES);
  }

  _isSeen(tick) {
    if (!this._shown) return false;
    const { first, step, columns } = this._shown;
    return tick >= first && tick < first + step * columns;
  }

  /** Put the line of the tick, and the mark of the square that the keys are at. */
  _place() {
    if (!this._shown || this._frame === null) return;
    const { sensor } = this._shown;
    const across = (tick) => this._begin(tick + 0.5);
    this._now.hidden = !this._isSeen(this._frame.tick);
    this._now.style.transform = `translateX(${across(this._frame.tick)}px)`;
    this._at.hidden = this._cursor === null || !this._isSeen(this._cursor.tick);
    if (this._at.hidden) return;
    const down = (this._cursor.sensor - sensor) * HIGH;
    this._at.style.transform = `translate(${across(this._cursor.tick) - 4}px, ${down}px)`;
  }

  /** The square under the pointer; null: none. */
  _under({ offsetX, offsetY }) {
    if (!this._shown) return null;
    const { first, step, columns, sensor, rows } = this._shown;
    const column = Math.floor(((offsetX - NAMES) / (this._width - NAMES)) * columns);
    const row = Math.floor(offsetY / HIGH);
    if (row < 0 || row >= rows) return null;
    const tick = column < 0 || column >= columns ? null : first + column * step;
    return { tick, sensor: sensor + row };
  }

  _tell(square) {
    write(this._says, square === null || !this._shown ? "" : this._words(square));
  }

  _words({ tick, sensor }) {
    const name = this._names[sensor];
    if (tick === null) return name;
    const { first, step, sensors, sensor: from } = this._shown;
    const value = this._bytes[((tick - first) / step) * sensors + sensor - from];
    return `${name}, tick ${tick}: ${WORDS[value] ?? "not read yet"}`;
  }

  _go(square) {
    if (square === null) return;
    this._cursor = square.tick === null ? null : square;
    this._on.pick(square.sensor);
    if (square.tick !== null) this._on.seek(square.tick);
    this._place();
  }

  _key(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!this._shown || (way === undefined && event.key !== "Enter")) return;
    event.preventDefault();
    event.stopPropagation(); // the page goes from tick to tick by these
    const { first, step, columns, sensor, rows } = this._shown;
    const at = this._cursor ?? { tick: this._isSeen(this._frame.tick) ? this._frame.tick : first, sensor };
    const column = Math.floor((at.tick - first) / step);
    const within = (value, most) => Math.min(Math.max(value, 0), most - 1);
    const [across, down] = way ?? [0, 0];
    this._cursor = {
      tick: first + within(column + across, columns) * step,
      sensor: sensor + within(at.sensor - sensor + down, rows),
    };
    this._tell(this._cursor);
    this._place();
    this._at.scrollIntoView({ block: "nearest" });
    if (event.key === "Enter") this._go(this._cursor);
  }
}

/** The values of a part as the server sends them. */
export const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** The red, green and blue of a colour as the browser says it. */
const rgb = (colour) => (colour.match(/[\d.]+/g) ?? [0, 0, 0]).slice(0, 3).map(Number);

/** A picture of values, column by column of so many sensors: a pixel each, the first rows. */
export function imageOf(colours, known, columns, rows, sensors) {
  const inks = INKS.map((name) => rgb(colours[name] ?? colours.accent));
  inks[5] = inks[3].map((part, k) => Math.round((part + inks[2][k]) / 2));
  const image = new ImageData(columns, rows);
  for (let column = 0; column < columns; column += 1) {
    for (let row = 0; row < rows; row += 1) {
      const ink = inks[known[column * sensors + row]];
      image.data.set([...ink, 255], 4 * (row * columns + column));
    }
  }
  const small = new OffscreenCanvas(columns, rows);
  small.getContext("2d").putImageData(image, 0, 0);
  return small;
}
