// Says that what is shown is not what was asked for: it is being read, or cannot be.

import { find, write } from "../base/dom.js";

const PATIENCE = 150; // milliseconds that pass for at once

/** The sign over the diagram. */
export class Lateness {
  /** A tick is asked for, while another is shown; null: none is. */
  wait(asked, shown) {
    clearTimeout(this._timer);
    const still = shown === null ? "" : `; this is tick ${shown}`;
    this._timer = setTimeout(() => this._say(`reading tick ${asked}${still}`, true), PATIENCE);
  }

  /** A tick that was asked for is not to be had, and another is still shown. */
  miss(asked, shown) {
    clearTimeout(this._timer);
    if (shown === null || shown === asked) this.end();
    else this._say(`this is tick ${shown}, not tick ${asked}`, false);
  }

  /** What is shown is what was asked for. */
  end() {
    clearTimeout(this._timer);
    this._say("", false);
  }

  _say(text, isBusy) {
    write(find("late"), text);
    find("late").hidden = text === "";
    find("late").classList.toggle("busy", isBusy);
    document.body.classList.toggle("late", text !== "");
  }
}
