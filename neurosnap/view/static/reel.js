// The frames of a recording, as far as they were looked at: fetched in blocks, the next
// block before it is needed, and those looked at longest ago forgotten.

/** Ticks in a block: two seconds at sixty a second, half of what the server gives. */
export const BLOCK = 120;

const KEPT = 48;

/** Frames by tick. */
export class Reel {
  /** @param {(from: number, to: number) => Promise<object[]>} fetchFrames */
  constructor(fetchFrames) {
    this._fetch = fetchFrames;
    this._blocks = new Map(); // by number, the one looked at last at the end
    this._asked = new Map(); // questions that are not answered yet
  }

  /** The frame of a tick, if it is here; undefined otherwise. */
  peek(tick) {
    const number = Math.floor(tick / BLOCK);
    const block = this._blocks.get(number);
    if (block === undefined) return undefined;
    this._blocks.delete(number);
    this._blocks.set(number, block);
    return block.get(tick);
  }

  /** The frame of a tick; undefined if the recording has none. */
  async at(tick) {
    const frame = this.peek(tick);
    if (frame !== undefined) return frame;
    await this.load(Math.floor(tick / BLOCK));
    return this.peek(tick);
  }

  /** Have what follows a tick ready soon, in the direction one goes. */
  prefetch(tick, step, last) {
    const number = Math.floor(tick / BLOCK) + step;
    if (number < 0 || number * BLOCK > last || this._blocks.has(number)) return;
    this.load(number).catch(() => {}); // whoever needs it asks again, and hears why
  }

  /** Fetch a block, whatever is here of it already. */
  load(number) {
    if (!this._asked.has(number)) {
      const [from, to] = [Math.max(1, number * BLOCK), (number + 1) * BLOCK - 1];
      const asked = this._asked;
      const answered = this._fetch(from, to)
        .then((frames) => {
          // What was asked of a recording that was since forgotten is of no use.
          if (asked === this._asked) frames.forEach((frame) => this.add(frame));
        })
        .finally(() => asked.delete(number));
      asked.set(number, answered);
    }
    return this._asked.get(number);
  }

  /** Keep a frame. */
  add(frame) {
    const number = Math.floor(frame.tick / BLOCK);
    if (!this._blocks.has(number)) this._blocks.set(number, new Map());
    this._blocks.get(number).set(frame.tick, frame);
    if (this._blocks.size > KEPT) this._blocks.delete(this._blocks.keys().next().value);
  }

  /** Forget everything: it is another recording now. */
  clear() {
    this._blocks.clear();
    this._asked = new Map();
  }
}
