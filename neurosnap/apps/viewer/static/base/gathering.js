// What a server reads in the background: asked for again until all of it is there.

const AGAIN = 700; // milliseconds until it is asked for once more

/** Asks for something, one question at a time. */
export class Gathering {
  /** @param {() => Promise<boolean>} ask told to ask, and tells whether that was all */
  constructor(ask) {
    this._ask = ask;
    this._asking = false;
    this._due = false;
  }

  /** Ask until all of it is there; who is asking already asks once more. */
  async load() {
    this._due = true; // there may be more than was asked for
    if (this._asking) return;
    this._asking = true;
    try {
      for (let done = false; !done || this._due; ) {
        this._due = false;
        done = await this._ask();
        if (!done || this._due) await new Promise((soon) => setTimeout(soon, AGAIN));
      }
    } finally {
      this._asking = false;
    }
  }
}
