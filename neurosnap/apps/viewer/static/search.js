// Finding sensors by name: all that match are marked, and Enter goes from one to the next.

import { find, write } from "./dom.js";

/** The search field. */
export class Search {
  /**
   * @param {string[]} names
   * @param {import("./growth.js").GrowthView} growth
   * @param {{mark: (found: Set<number>|null) => void, pick: (sensor: number) => void}} on
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

  _look() {
    const text = this._field.value.trim().toLowerCase();
    const names = this._names.map((name) => name.toLowerCase());
    const matches = (name, sensor) => name.includes(text) && this._growth.isSensor(sensor);
    const all = names.flatMap((name, sensor) => (matches(name, sensor) ? [sensor] : []));
    this._found = text ? all : [];
    // A name that is the whole of what was typed comes first.
    this._found.sort((a, b) => (names[b] === text) - (names[a] === text) || a - b);
    this._next = 0;
    const count = this._found.length;
    write(find("search-found"), text ? (count ? `${count} found` : "none") : "");
    this._on.mark(text ? new Set(this._found) : null);
  }

  _clear() {
    this._field.value = "";
    this._look();
    this._field.blur();
  }
}
