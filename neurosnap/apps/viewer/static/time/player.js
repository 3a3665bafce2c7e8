// Where one is in the recording, and how one moves: one position in ticks, driven by the
// screen's own frames while it plays. The part after the point is how far the tick has
// gone, which is what a wave is shown by.

/** Ticks a second that can be chosen. */
export const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20, 60];

const LONGEST = 250; // milliseconds a single step may stand for: a tab may have slept
// Milliseconds it begins with: half a frame. Where ticks come as fast as frames, each then
// falls into the middle of one, and a frame that is a little late or early skips none.
const AHEAD = 1000 / 60 / 2;

/** The position, and playing. */
export class Player {
  /**
   * @param {object} on
   * @param {(tick: number) => boolean} on.ready whether a tick can be shown at once
   * @param {() => void} on.move told of every new position
   * @param {() => void} on.change told when it starts, stops, or plays at another speed
   */
  constructor(on) {
    this._on = on;
    this.first = 1;
    this.last = 0;
    this.position = 1;
    this.playing = false;
    this.following = false; // the newest tick of a run that is under way
    this.range = null; // the first and the last of the ticks that are repeated
    this.speed = 2;
    this._before = null; // when the last frame was; null: there was none yet
  }

  get tick() {
    return Math.floor(this.position);
  }

  /** Between which ticks one can move. */
  setRange(first, last) {
    [this.first, this.last] = [first, last];
    this._to(this.following || this.tick > last ? last : this.position);
    this._on.change();
  }

  /** Go to a tick, or to the nearest there is, and stop there. */
  seek(tick) {
    this.pause();
    this.following = false;
    this._to(Math.min(tick, this.last));
    this._on.change();
  }

  /** Go some ticks on or back. */
  step(ticks) {
    this.seek(this.tick + ticks);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.playing || this.last < this.first) return;
    const [from, to] = this.range ?? [this.first, this.last];
    const isInside = this.tick >= from && this.tick <= to;
    if (this.range ? !isInside : this.tick >= to) this._to(from);
    this.playing = true;
    this.following = false;
    this._before = null; // this very moment may be later than the frame that comes
    requestAnimationFrame(this._advance);
    this._on.change();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this._to(this.tick);
    this._on.change();
  }

  /** Stay at the newest tick from now on. */
  follow() {
    this.pause();
    this.following = true;
    this._to(this.last);
    this._on.change();
  }

  setSpeed(speed) {
    this.speed = speed;
    this._on.change();
  }

  _to(position) {
    const most = Math.max(this.last, this.first) + 0.999;
    this.position = Math.min(Math.max(position, this.first), most);
    this._on.move();
  }

  _advance = (now) => {
    if (!this.playing) return;
    const passed = this._before === null ? AHEAD : Math.min(now - this._before, LONGEST);
    this._before = now;
    let next = this.position + (passed / 1000) * this.speed;
    if (this.range && Math.floor(next) > this.range[1]) next = this.range[0];
    if (Math.floor(next) >= this.last + 1) {
      this.pause();
      return;
    }
    // What is not here yet is waited for, not skipped.
    if (this._on.ready(Math.floor(next))) this._to(next);
    requestAnimationFrame(this._advance);
  };
}
