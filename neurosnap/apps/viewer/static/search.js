// Finding sensors by name: all that match are marked, and Enter goes from one to the next.

import { find, write } from "./dom.js";

/** The search field. */
export class Search {
  /**
   * @param {string[]} names
   * @param {{mark: (found: Set<number>|null) => void, pick: (sensor: number) => void}} on
   */
  constructor(names, on) {
    this._names = names.map((name) => name.toLowerCase());
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
    const all = this._names.map((_, sensor) => sensor);
    this._found = text ? all.filter((sensor) => this._names[sensor].includes(text)) : [];
    // A name that is the whole of what was typed comes first.
    this._found.sort((a, b) => (this._names[b] === text) - (this._names[a] === text) || a - b);
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
