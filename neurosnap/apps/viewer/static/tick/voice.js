// Announcements to screen readers: a tick and its changes, once the position stays there.

import { find } from "../base/dom.js";
import { conditions, few } from "../base/literals.js";
import { changedWords } from "../run/growth.js";

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

  /** Say something else, once, in place of the tick. */
  tell(text) {
    clearTimeout(this._timer);
    find("said").textContent = text;
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
    const grew = changedWords(frame);
    find("said").textContent = `tick ${frame.tick}${did}${grew && `, ${grew}`}${named && `: ${named}`}`;
  }
}
