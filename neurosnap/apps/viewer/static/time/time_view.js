// The panels of time: the player with its slider, the strip, the range, plots and raster.

import { find } from "../base/dom.js";
import { Player, TickRange, Timeline } from "./player.js";
import { Plots } from "./plots.js";
import { RasterView } from "./raster.js";
import { Strip } from "./strip.js";

/** The footer, and the panels over time. */
export class TimeView {
  /**
   * @param {string[]} names
   * @param {object} on
   * @param {(tick: number) => boolean} on.ready whether a tick can be shown at once
   * @param {() => void} on.move told of every new position
   * @param {(sensor: number) => void} on.pick
   */
  constructor(names, on) {
    const range = (from, to) => this.range.set([from, to]);
    const seek = (tick) => this.player.seek(tick);
    this.player = new Player({ ready: on.ready, move: on.move, change: () => this.timeline.showPlayer() });
    this.timeline = new Timeline(this.player);
    this.strip = new Strip({ seek });
    this.plots = new Plots(find("plots"), { seek, range });
    this.raster = new RasterView(names, { seek, pick: on.pick });
    this.range = new TickRange(() => this._showRange());
  }

  /** Show a tick. */
  at(frame) {
    this.plots.at(frame, this.player.playing);
    this.raster.at(frame);
  }

  /** Between which ticks one can move. */
  setEnds(first, last) {
    this.player.setRange(first, last);
    this.range.setEnds(first, last);
    this._showRange();
    this.strip.load(first, last).catch(() => {}); // said where it was asked
  }

  /** Show the ticks one looks at over time, and repeat them. */
  _showRange() {
    const { shown, chosen } = this.range;
    this.player.range = chosen && shown;
    this.strip.choose(chosen);
    this.plots.load(...shown);
    this.raster.load(...shown);
  }
}
