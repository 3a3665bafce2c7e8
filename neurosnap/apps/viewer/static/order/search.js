// Finding sensors by name, by what is believed of them, by what they read: all that match
// are marked, and Enter goes from one to the next.

import { beliefs } from "../tick/belief.js";
import { find, write } from "../base/dom.js";
import { bitWord } from "../base/literals.js";

const BELIEVED = ["on", "off", "unknown", "contradicted", "predicted", "grown"];
const READ = ["on", "off", "unknown"];

/** The search field. */
export class Search {
  /**
   * @param {string[]} names
   * @param {import("../run/growth.js").GrowthView} growth
   * @param {object} on
   * @param {(found: Set<number>|null) => void} on.mark
   * @param {(sensor: number) => void} on.pick
   * @param {(sensor: number) => boolean} on.isGrown
   */
  constructor(names, growth, on) {
    this._names = names;
    this._growth = growth;
    this._on = on;
    this._field = find("search-text");
    this._found = [];
    this._next = 0;
    this._field.addEventListener("input", () => this._look());
    this._field.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this._clear();
    });
    find("search").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this._found.length === 0) return;
      this._on.pick(this._found[this._next]);
      this._next = (this._next + 1) % this._found.length;
    });
  }

  /** Go to the field. */
  focus() {
    this._field.focus();
    this._field.select();
  }

  /** A tick is shown: what is found by its state may be other sensors now. */
  show(frame) {
    this._frame = frame;
    if (this._field.value.includes(":")) this._look();
  }

  _look() {
    const text = this._field.value.trim().toLowerCase();
    const names = this._names.map((name) => name.toLowerCase());
    const asked = text.split(/\s+/).filter(Boolean).map((word) => this._asked(word, names));
    const wrong = asked.find((one) => typeof one === "string");
    const matches = (_, sensor) =>
      this._growth.isSensor(sensor) && asked.every((is) => is(sensor));
    const all = names.flatMap((name, sensor) => (!wrong && matches(name, sensor) ? [sensor] : []));
    this._found = text ? all : [];
    // A name that is the whole of what was typed comes first.
    this._found.sort((a, b) => (names[b] === text) - (names[a] === text) || a - b);
    this._next = 0;
    const count = this._found.length;
    write(find("search-found"), wrong ?? (text ? (count ? `${count} found` : "none") : ""));
    this._on.mark(text ? new Set(this._found) : null);
  }

  /** What a word asks of a sensor; a text says what is wrong with it. */
  _asked(word, names) {
    const [, key, value] = /^(is|reads):(.*)$/.exec(word) ?? [];
    if (key === undefined) return (sensor) => names[sensor].includes(word);
    const known = key === "is" ? BELIEVED : READ;
    if (!known.includes(value)) return `${key}: one of ${known.join(", ")}`;
    if (value === "grown") return this._on.isGrown;
    const { bits } = this._frame;
    if (key === "reads") return (sensor) => bitWord(bits[sensor]) === value;
    const held = beliefs(this._frame);
    if (value === "predicted") return (sensor) => held[sensor].predicted;
    return (sensor) => held[sensor].condition === value;
  }

  _clear() {
    this._field.value = "";
    this._look();
    this._field.blur();
  }
}
