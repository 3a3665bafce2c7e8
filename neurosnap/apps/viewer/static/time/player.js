// The player: the current position in ticks, playback and seeking.
// The screen's own frames drive it while it plays. The part after the point is how far the
// tick has gone, which is what a wave is shown by.

import { keepSoon, told } from "../base/address.js";
import { find, make, write } from "../base/dom.js";

/** Ticks a second that can be chosen. */
const SPEEDS = [0.5, 1, 2, 5, 10, 20];

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
    if (Math.floor(next) > this.last) {
      if (this.tick >= this.last) {
        this.pause();
        return;
      }
      next = this.last; // a frame came late: the last tick is shown all the same
    }
    // What is not here yet is waited for, not skipped.
    if (this._on.ready(Math.floor(next))) this._to(next);
    requestAnimationFrame(this._advance);
  };
}

// The time line: a slider over the whole recording, what is beside it, and the tick in the
// page's address. Its buttons are those of keys.

const PLAY = "M4 2.5v11L13 8z";
const PAUSE = "M4 3h3v10H4zM9 3h3v10H9z";

/** The footer, bound to a player. */
export class Timeline {
  /** @param {import("./player.js").Player} player */
  constructor(player) {
    this._player = player;
    this._slider = find("time");
    this._slider.addEventListener("input", () => player.seek(Number(this._slider.value)));
    const speeds = SPEEDS.map((speed) => make("option", { value: speed }, `${speed}/s`));
    find("speed").append(...speeds);
    find("speed").addEventListener("change", (event) =>
      player.setSpeed(Number(event.target.value)),
    );
    find("follow").addEventListener("click", () => player.follow());
  }

  /** Show what the player does. */
  showPlayer() {
    const { first, last, playing, speed, following } = this._player;
    this._slider.min = first;
    this._slider.max = Math.max(first, last);
    this._slider.disabled = last < first;
    find("speed").value = speed;
    find("follow").setAttribute("aria-pressed", following);
    find("play").querySelector("path").setAttribute("d", playing ? PAUSE : PLAY);
    find("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    this.showTick();
  }

  /** Show where the player is. */
  showTick() {
    const { tick, last, first, playing, following } = this._player;
    const text = last < first ? "no tick" : `tick ${tick} of ${last}`;
    this._slider.value = tick;
    this._slider.setAttribute("aria-valuetext", text);
    write(find("tick"), text);
    // Who follows has no tick in the address: the page opened anew would not follow.
    if (!playing && last >= first) keepSoon({ t: following ? null : tick });
  }
}

// The range of ticks one looks at: playing repeats it, curves and raster show it alone, and
// the address holds it.

/** The range, null: all ticks. */
export class TickRange {
  /**
   * @param {() => void} change told of every change
   */
  constructor(change) {
    this._change = () => {}; // who is told is not there yet
    this._ends = [1, 0];
    this.chosen = null;
    this.restore();
    this._change = change;
  }

  /** Between which ticks one can move. */
  setEnds(first, last) {
    this._ends = [first, last];
  }

  /** The first and the last tick to show: of a link they may be of a longer run. */
  get shown() {
    const [first, last] = this._ends;
    return this.chosen?.map((tick) => Math.min(Math.max(tick, first), last)) ?? this._ends;
  }

  /** Choose two ticks, the earlier first, and all between them; null: all there are. */
  set(chosen) {
    this._take(chosen);
    keepSoon({ range: this.chosen && this.chosen.join("-") });
  }

  /** Let it begin (0) or end (1) at a tick; where the other end is passed, that goes. */
  setEnd(which, tick) {
    const ends = [...this.shown];
    ends[which] = tick;
    if (ends[0] > ends[1]) ends[1 - which] = this._ends[1 - which];
    this.set(ends);
  }

  /** Take the range that the address says. */
  restore() {
    const [, from, to] = /^(\d+)-(\d+)$/.exec(told().get("range") ?? "") ?? [];
    this._take(from === undefined || Number(from) > Number(to) ? null : [Number(from), Number(to)]);
  }

  _take(chosen) {
    if (String(chosen) === String(this.chosen)) return;
    this.chosen = chosen;
    for (const id of ["range", "range-compare"]) find(id).hidden = chosen === null;
    write(find("range"), chosen ? `↻ ${chosen[0]} to ${chosen[1]} ×` : "");
    this._change();
  }
}
