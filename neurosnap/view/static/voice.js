// What a screen reader is told by itself: where one is and what changed, once it stays.

import { find } from "./dom.js";
import { conditions, few } from "./literals.js";

const PATIENCE = 600; // milliseconds of rest before anything is said
const NAMED = 5;

/** Says ticks, politely. */
export class Voice {
  /** @param {string[]} names */
  constructor(names) {
    this._names = names;
    this._words = null;
  }

  /** A tick is shown; say so if it stays. */
  show(frame) {
    clearTimeout(this._timer);
    this._timer = setTimeout(() => this._say(frame), PATIENCE);
  }

  _say(frame) {
    const words = conditions(frame);
    const before = this._words ?? words;
    this._words = words;
    const changed = words.flatMap((word, sensor) =>
      word === before[sensor] ? [] : [`${this._names[sensor]} ${word}`],
    );
    const named = few(changed, NAMED);
    const did = frame.action ? `, then ${frame.action}` : "";
    find("said").textContent = `tick ${frame.tick}${did}${named && `: ${named}`}`;
  }
}
