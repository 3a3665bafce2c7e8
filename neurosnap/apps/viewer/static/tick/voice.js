// Announcements: ticks and changes to screen readers, problems to all users.
// A tick is announced once the position stays there; problems are shown at the top.

import { GONE } from "../base/api.js";
import { find, write } from "../base/dom.js";
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

/** What is amiss, said by several: none wipes away what another said. */
export class Notices {
  constructor() {
    this._words = new Map();
  }

  /** Say something in the name of `who`; nothing: it is no longer so. */
  say(who, text) {
    if (text === (this._words.get(who) ?? "")) return;
    this._words.set(who, text);
    const all = [...new Set(this._words.values())].filter(Boolean).join(" · ");
    write(find("notice"), all);
    find("notice").title = all; // there may not be room for all of it
    find("notice").hidden = all === "";
    // What is shown is what was read before.
    const isOld = ["link", "file"].some((one) => this._words.get(one));
    document.body.classList.toggle("old", isOld);
  }

  /** Say whether the server is there, which every answer shows. */
  link(here) {
    this.say("link", here ? "" : GONE);
  }

  /** Have a question say what goes wrong, until it is answered again. */
  watched(who, ask) {
    return async (...asked) => {
      try {
        const answer = await ask(...asked);
        this.say(who, "");
        this.link(true);
        return answer;
      } catch (error) {
        if (error.message === GONE) this.link(false);
        else this.say(who, error.message);
        throw error;
      }
    };
  }
}
