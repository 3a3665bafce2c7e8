// The time line: a slider over the whole recording, buttons around it, and the tick in
// the page's address.

import { keep } from "../base/address.js";
import { find, make, write } from "../base/dom.js";
import { SPEEDS } from "./player.js";

const PLAY = "M4 2.5v11L13 8z";
const PAUSE = "M4 3h3v10H4zM9 3h3v10H9z";
const PATIENCE = 500; // milliseconds of rest before the address is written

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
    find("play").addEventListener("click", () => player.toggle());
    find("back").addEventListener("click", () => player.step(-1));
    find("on").addEventListener("click", () => player.step(1));
    find("start").addEventListener("click", () => player.step(-Infinity));
    find("end").addEventListener("click", () => player.step(Infinity));
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
    const { tick, last, first } = this._player;
    const text = last < first ? "no tick" : `tick ${tick} of ${last}`;
    this._slider.value = tick;
    this._slider.setAttribute("aria-valuetext", text);
    write(find("tick"), text);
    clearTimeout(this._timer);
    this._timer = setTimeout(() => this._keep(), PATIENCE);
  }

  /**
   * Have the address say where one stays. Not at once: browsers refuse to have it written
   * too often. Who follows has no tick there: the page opened anew would not follow.
   */
  _keep() {
    const { tick, first, last, playing, following } = this._player;
    if (playing || last < first) return;
    keep({ t: following ? null : tick });
  }
}
