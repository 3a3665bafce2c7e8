// A cache of a recording's frames: fetched in blocks, the next one in advance.
// Those looked at longest ago are forgotten.

const BLOCK = 24; // ticks: of a run that imagines each may take half a second
const KEPT = 240;
const REST = 1000; // milliseconds until a block that could not be had is asked for again

/** Frames by tick. */
export class FrameCache {
  /** @param {(from: number, to: number) => Promise<object[]>} fetchFrames */
  constructor(fetchFrames) {
    this.last = 0; // the last tick there is, as far as is known
    this._fetch = fetchFrames;
    this._blocks = new Map(); // by number, the one looked at last at the end
    this._asked = new Map(); // questions that are not answered yet, or were in vain
    this._next = null; // the block that was gone to last
    this._ahead = Promise.resolve(); // once the one that is fetched for later is here
  }

  /** The frame of a tick; null: the recording has none; undefined: it is not here. */
  peek(tick) {
    const number = Math.floor(tick / BLOCK);
    const block = this._blocks.get(number);
    if (block === undefined) return undefined;
    this._blocks.delete(number);
    this._blocks.set(number, block);
    return block.frames.get(tick) ?? (tick <= block.told ? null : undefined);
  }

  /** The frame of a tick, once it is here, before others; null: the recording has none. */
  async at(tick) {
    if (tick <= this.last && this.peek(tick) === undefined) {
      await this._loadFirst(Math.floor(tick / BLOCK), tick);
    }
    // An answer may be to a question from before the recording had this tick.
    while (tick <= this.last && this.peek(tick) === undefined) {
      await this._load(Math.floor(tick / BLOCK));
    }
    return this.peek(tick);
  }

  /** Whether the frame of a tick is here; if not it is soon, and so is the next block. */
  isReady(tick) {
    for (const wanted of [tick, (Math.floor(tick / BLOCK) + 1) * BLOCK]) {
      if (wanted > this.last || this.peek(wanted) !== undefined) continue;
      this._load(Math.floor(wanted / BLOCK)).catch(() => {}); // who needs it asks again
    }
    return this.peek(tick) !== undefined;
  }

  /** Keep a frame. */
  add(frame) {
    this._block(Math.floor(frame.tick / BLOCK)).frames.set(frame.tick, frame);
  }

  /** Forget everything: it is another recording now. */
  clear() {
    this.last = 0;
    this._blocks.clear();
    this._asked = new Map();
  }

  /**
   * Fetch the one frame of a block that is wanted now, and then the block, which takes
   * longer: its order is asked for in between.
   */
  async _loadFirst(number, tick) {
    await this._askOnce(`first of ${number}`, tick, tick, () => {
      this._next = number;
      this._ahead = this._ahead.then(async () => {
        await new Promise(setTimeout);
        // One at a time, of those that were gone to the last. Who needs it is told why.
        if (this._next === number) await this._load(number).catch(() => {});
      });
    });
  }

  /** Fetch a block, whatever is here of it already. */
  _load(number) {
    const [from, to] = [Math.max(1, number * BLOCK), (number + 1) * BLOCK - 1];
    const told = Math.min(to, this.last);
    return this._askOnce(number, from, to, () => (this._block(number).told = told));
  }

  /** Ask for frames, unless they are asked for; one that failed rests before the next. */
  _askOnce(key, from, to, then) {
    const asked = this._asked;
    if (!asked.has(key)) {
      const answered = this._fetch(from, to).then(
        (frames) => {
          asked.delete(key);
          // What was asked of a recording that was since forgotten is of no use.
          if (asked !== this._asked) return;
          for (const frame of frames) this.add(frame);
          then();
        },
        (error) => {
          setTimeout(() => asked.delete(key), REST);
          throw error;
        },
      );
      asked.set(key, answered);
    }
    return asked.get(key);
  }

  /** A block: its frames, and the tick up to which it has all that were recorded. */
  _block(number) {
    if (!this._blocks.has(number)) {
      this._blocks.set(number, { frames: new Map(), told: 0 });
      if (this._blocks.size > KEPT) this._blocks.delete(this._blocks.keys().next().value);
    }
    return this._blocks.get(number);
  }
}
