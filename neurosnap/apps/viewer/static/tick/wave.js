// One wave of a tick, hop by hop: its progress, and its depth against the order's height.

import { ask } from "../base/api.js";
import { counted, find, make, write } from "../base/dom.js";
import { literalName } from "../base/literals.js";

const HOP = 450; // milliseconds
const STATE = ""; // where the others have a name, which is never empty
const REST = 0.8; // hops' time that a wave played within a tick stands still at its end

/** The panel of the wave, and the clock it is shown by. */
export class WaveView {
  /**
   * @param {{names: string[], actions: string[], change: () => void}} on
   *   `change` is called when it shows something else
   */
  constructor(on) {
    this._on = on;
    this._wave = null;
    this._which = STATE; // or what keyOf returns
    this._at = null; // hops gone; null: it is not being looked at
    this._hops = new Map();
    this._started = null;
    find("wave-which").addEventListener("change", (event) => {
      this._which = event.target.value;
      this._take(this._frame);
      this._on.change();
    });
    find("wave-hop").addEventListener("input", (event) => {
      this._started = null;
      this._at = Number(event.target.value);
      this._changed();
    });
  }

  /** What the diagram shows of it: its hops by literal, and how many it has gone. */
  get shown() {
    return this._at === null ? null : { hops: this._hops, at: this._at };
  }

  /** Which wave is looked at, tick after tick; empty: the state's. */
  get which() {
    return this._which;
  }

  /** Look at the waves of a kind from now on. */
  take(which) {
    this._which = which;
    if (this._frame) this._take(this._frame);
  }

  /** The wave of this tick that is looked at; null: there is none. */
  get wave() {
    return this._wave;
  }

  /** Play a wave of this tick, or the deepest if it is not among those shown. */
  play(number) {
    const wave = this._frame.waves.find((one) => one.wave === number) ?? deepest(this._frame.waves);
    this._at = null;
    if (wave !== null) this.take(this._keyOf(wave));
    this.toggle();
  }

  /** What the wave is called. */
  get name() {
    return this._wave === null ? "" : this._nameOf(this._wave);
  }

  /** Whether it starts in a state that was only imagined. */
  get imagined() {
    return this._wave?.imagined ?? false;
  }

  /** Choose the wave of this tick that goes deepest, if one goes anywhere. */
  takeDeepest() {
    const wave = deepest(this._frame.waves);
    if (wave !== null) this.take(this._keyOf(wave));
  }

  /** Show another tick; its state, until its wave is asked for. */
  show(frame) {
    if (frame === this._frame) return;
    this._started = null;
    this._at = null;
    this._take(frame);
  }

  /** Let the wave run along with the tick, `part` of which has gone. */
  run(part) {
    if (!this._wave?.depth) return; // it goes nowhere: the state says more
    this._at = Math.min(part * (this._wave.depth + 1 + REST), this._wave.depth);
    this._say();
  }

  /** Start the wave from its signal, or stop looking at it. */
  toggle() {
    if (this._at !== null) {
      this._started = null;
      this._at = null;
      this._changed();
    } else if (this._wave !== null) {
      find("diagram").scrollIntoView({ block: "nearest" }); // a phone has scrolled it away
      // Who wants no motion goes hop by hop with the slider.
      const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
      this._at = still ? this._wave.depth : 0;
      this._started = still ? null : performance.now();
      if (!still) requestAnimationFrame(this._advance);
      this._changed();
    }
  }

  _advance = (now) => {
    if (this._started === null) return;
    const gone = Math.max(0, (now - this._started) / HOP);
    this._at = Math.min(gone, this._wave.depth);
    if (gone < this._wave.depth) requestAnimationFrame(this._advance);
    else this._started = null;
    this._changed();
  };

  _changed() {
    this._say();
    this._on.change();
  }

  _take(frame) {
    this._frame = frame;
    const known = new Map(frame.waves.map((wave) => [this._keyOf(wave), wave]));
    this._offer(known, frame.left_out);
    this._wave = known.get(this._which) ?? known.get(STATE) ?? null;
    if (this._wave?.hops === null) this._fetch(frame.tick, this._wave);
    this._hops = new Map(this._wave?.hops);
    if (this._at !== null) this._at = Math.min(this._at, this._wave?.depth ?? 0);
    find("wave-hop").max = this._wave?.depth ?? 0;
    this._say();
  }

  /** Ask for the hops of a wave, which imagined ones come without. */
  async _fetch(tick, wave) {
    wave.hops = []; // asked for once
    wave.hops = (await ask("wave", { tick, wave: wave.wave }).catch(() => wave)).hops;
    if (this._wave === wave) this._hops = new Map(wave.hops);
    this._changed();
  }

  /** What a wave has in common with those of other ticks that ask the same. */
  _keyOf({ kind, signal, action, imagined, wave }) {
    if (kind === "state") return STATE;
    const first = this._on.actions[action] ?? literalName(this._on.names, signal[0] ?? 0);
    return imagined ? `${first}, wave ${wave}` : first;
  }

  _nameOf(wave) {
    const { kind, signal, imagined } = wave;
    const key = this._keyOf(wave);
    if (kind === "state") return "state";
    if (imagined) return `imagined: ${key}`;
    if (this._on.actions.includes(key)) return `consequences of ${key}`;
    const others = signal.slice(1).map((literal) => literalName(this._on.names, literal));
    if (others.length > 1) return `signal ${key} and ${others.length} more`;
    return ["signal " + key, ...others].join(" + ");
  }

  /** Let one choose: what starts in the present state first, then what was imagined. */
  _offer(known, more) {
    const all = [...known].map(([key, wave]) => [key, this._nameOf(wave), wave.imagined]);
    const here = all.filter(([, , imagined]) => !imagined);
    const ahead = all.filter(([, , imagined]) => imagined);
    if (!known.has(this._which)) {
      const why = more > 0 ? "not among those shown" : "not at this tick";
      here.push([this._which, `${this._which || "state"}: ${why}`]);
    }
    const offered = JSON.stringify([here, ahead, more]);
    if (offered !== this._offered) {
      this._offered = offered;
      const options = (waves) => waves.map(([value, name]) => make("option", { value }, name));
      const imagined = make("optgroup", { label: "Imagined" }, ...options(ahead));
      const rest = `and ${more} more, not shown`;
      if (more > 0) imagined.append(make("option", { disabled: true }, rest));
      find("wave-which").replaceChildren(...options(here), ...(ahead.length ? [imagined] : []));
    }
    find("wave-which").value = this._which;
  }

  _say() {
    const [depth, hop] = [this._wave?.depth ?? 0, this._at === null ? null : Math.floor(this._at)];
    find("wave-hop").value = this._at ?? depth;
    find("wave-hop").setAttribute("aria-valuetext", `hop ${hop ?? depth} of ${depth}`);
    find("wave-play").disabled = this._wave === null;
    write(find("wave-play"), hop === null ? "Play wave" : "Show state");
    write(find("wave-says"), this._words(hop));
    const why = whyShallow(this._frame, this._wave);
    write(find("wave-why"), why);
    find("wave-why").hidden = why === "";
  }

  _words(hop) {
    if (this._wave === null) return "No wave of this tick was recorded.";
    const whole = this._wave.settled ? "" : " It has not settled.";
    const what = this._wave.imagined ? `${this.name}. `.replace("i", "I") : "";
    const all = `${this._hops.size} literals reached with ${this._wave.pulses} pulses.${whole}`;
    if (hop === null) return `${what}Depth ${this._wave.depth} of height ${this._frame.height}. ${all}`;
    const there = [...this._hops.values()].filter((at) => at <= hop).length;
    return `${what}Hop ${hop} of ${this._wave.depth}: ${there} of ${all}`;
  }
}

// Which wave of a tick goes deepest, and why that of the state goes nowhere.

/** The wave that goes deepest, of those that start in the present state if any of them does. */
function deepest(waves) {
  const deep = waves.filter(({ depth }) => depth > 0);
  const here = deep.filter(({ imagined }) => !imagined);
  const offered = here.length > 0 ? here : deep;
  return offered.reduce((best, wave) => (wave.depth > (best?.depth ?? 0) ? wave : best), null);
}

/** Why a state wave has depth 0; empty: it has more, or it is no state wave. */
function whyShallow(frame, wave) {
  if (wave === null || wave.kind !== "state" || wave.depth > 0 || !wave.settled) return "";
  const isRead = (_, sensor) => sensor < frame.sensors && !frame.retired.includes(sensor);
  const bits = frame.bits.filter(isRead);
  const unread = bits.filter((bit) => bit === null).length;
  if (unread === 0) return `All ${counted(bits.length, "sensor")} were read: nothing to infer.`;
  const missing = `${counted(unread, "sensor")} ${unread === 1 ? "was" : "were"} not read`;
  return `${missing}, and no reading implies anything of ${unread === 1 ? "it" : "them"}.`;
}
