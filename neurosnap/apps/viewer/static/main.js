// The main module: loads the frame at the player's position and updates every view.
// Everything shown follows from that position.

import { choiceAsked, keepChoice, keepWave, tickAsked, told, waveAsked } from "./base/address.js";
import { ask, openEvents, run as runNumber, say, sayLink, stopAsking } from "./base/api.js";
import { find, flash, link, make, write } from "./base/dom.js";
import { explain } from "./base/terms.js";
import { bind } from "./keys.js";
import { OrderView } from "./order/order_view.js";
import { DepthView } from "./run/depths.js";
import { FindingsView } from "./run/findings.js";
import { FrameCache } from "./run/frames.js";
import { GrowthView } from "./run/growth.js";
import { attend, chooseRun, follow, Lateness } from "./run/live.js";
import { Reasons } from "./tick/belief.js";
import { ChoiceView } from "./tick/choice.js";
import { FactsView } from "./tick/facts.js";
import { Outline } from "./tick/outline.js";
import { Voice } from "./tick/voice.js";
import { WaveView } from "./tick/wave.js";
import { ImageView, WorldView } from "./tick/world.js";
import { CompareView } from "./time/compare.js";
import { TimeView } from "./time/time_view.js";

const AGAIN = 700; // milliseconds until ticks to go to are asked for once more
const [PATIENCE, NAMED] = [1, 4]; // seconds that a wave may take; cells that are named
const SLOW = 2; // ticks a second up to which a tick's wave is shown on its way

const said = () => {}; // the failure was reported where it was asked

/** All parts of the page of one run. */
class Page {
  constructor(run) {
    this.run = run;
    this.frame = null;
    this.late = new Lateness();
    this.played = false;
    this.live = false; // the run was seen under way
    this.opening = false; // it goes to the last finding, once there is one
    this.home = "plots"; // the panel of the dock that is open where no other was chosen
    this.panels = 0; // how many were opened
    this.received = Promise.resolve(); // once all that came has been taken in
    const names = [...run.sensors]; // what is grown gets its name later
    this.names = names;
    const pick = (thing) => this.pick(thing);
    const goTo = (sensor) => this.goTo(sensor);
    const seek = (tick) => this.time.player.seek(tick);
    this.growth = new GrowthView(run, { seek, pick: goTo, change: () => this.learnBirths() });
    this.findings = new FindingsView(names, {
      isLive: () => this.run.live,
      seek,
      pick: goTo,
      change: (done) => this.learnFindings(done),
    });
    this.frameCache = new FrameCache(async (from, to) => (await ask("frames", { from, to })).frames);
    this.time = new TimeView(names, {
      ready: (tick) => this.frameCache.isReady(tick),
      move: () => this.move(),
      pick: goTo,
    });
    this.order = new OrderView(names, this.growth, {
      choose: (thing) => this.choose(thing),
      goTo,
      rename: (named) => this.rename(named),
      change: () => this.showWords(),
      reasons: () => this.reasons(),
    });
    this.wave = new WaveView({ names, actions: run.actions, change: () => this.changeWave() });
    this.depths = new DepthView((dot) => this.playWave(dot));
    this.facts = new FactsView(names, run);
    this.world = new WorldView(run.world);
    this.image = new ImageView(run);
    this.voice = new Voice(names);
    this.outline = new Outline(find("sensors"), names, goTo);
    this.choice = new ChoiceView(names, { pick: (thing) => this.choose(thing) });
    this.compare = new CompareView(names, run, { seek, pick });
  }

  // Moving through time --------------------------------------------------------------

  /** The player is somewhere else: show it, as soon as it is here. */
  move() {
    this.time.timeline.showTick();
    const { tick } = this.time.player;
    const frame = this.frameCache.peek(tick);
    if (frame !== undefined) {
      this.arrive(frame);
      return;
    }
    document.body.ariaBusy = true;
    this.late.wait(tick, this.frame?.tick ?? null);
    this.frameCache
      .at(tick)
      .catch(said)
      .then((late) => {
        if (this.time.player.tick === tick) this.arrive(late);
      });
  }

  /** Show a frame; null if its tick was not recorded. */
  arrive(frame) {
    document.body.ariaBusy = false;
    const missing = `tick ${this.time.player.tick} was not recorded`;
    say("tick", frame === null ? missing : "");
    if (frame) {
      this.late.end();
      this.show(frame);
    } else {
      this.late.miss(this.time.player.tick, this.frame?.tick ?? null);
    }
  }

  show(frame) {
    const { playing, speed, position } = this.time.player;
    // What is shown only now and then while it plays has to be right once it stops.
    const isFirst = this.frame === null;
    const another = frame !== this.frame || playing !== this.played;
    const waving = this.wave.shown !== null;
    this.played = playing;
    this.frame = frame;
    this.wave.show(frame);
    if (playing && speed <= SLOW) this.wave.run(position % 1);
    if (another) this.showTick();
    else if (waving || this.wave.shown !== null) this.showDiagram();
    if (isFirst && this.opening && this.findings.listed.length === 0) this.wave.takeDeepest();
    if (isFirst) this.restore();
  }

  /** Select what the link selects. */
  restore() {
    const [choice, wave] = [choiceAsked(this.names), waveAsked()];
    if (typeof choice === "string") say("asked", `there is no ${choice} here`);
    else if (choice?.sensor !== undefined) this.goTo(choice.sensor);
    else if (choice) this.choose(choice);
    if (wave) this.wave.take(wave);
  }

  /** Show what stays the same as long as the tick does. */
  showTick() {
    const { frame } = this;
    const { playing } = this.time.player;
    const before = this.frameCache.peek(frame.tick - 1);
    this.order.show(frame, this.wave.shown, playing);
    this.showWave();
    this.facts.show(frame, before);
    this.showFindings();
    this.world.show(frame);
    this.image.show(frame);
    this.time.at(frame);
    this.compare.show(frame, playing);
    this.voice.show(frame);
  }

  /** Call sensors by their names. */
  rename(named) {
    const another = named.filter(({ sensor, name }) => this.names[sensor] !== name);
    for (const { sensor, name } of another) this.names[sensor] = name;
    if (another.length === 0) return;
    this.outline.rename();
    this.choice.rename();
  }

  /** More is known of what was grown. */
  learnBirths() {
    this.rename(this.growth.births);
    this.showWhat();
    if (this.frame) this.showTick();
  }

  /** More is known of what was wrong; a run that has ended opens at the last of it. */
  learnFindings(done) {
    const [newest] = this.findings.listed;
    this.time.raster.mark(this.findings.listed);
    if (this.frame) this.showFindings();
    if (newest && this.home !== "findings") {
      this.home = "findings";
      if (this.panels === 1 && !told().has("tab")) find("tab-findings").click();
    }
    if (!done || !newest || !this.opening) return;
    this.opening = false;
    const { player } = this.time;
    if (player.playing || player.tick !== this.run.ticks) return;
    this.wave.take("");
    player.seek(newest.tick);
  }

  showFindings() {
    this.findings.show(this.frame);
    this.order.diagram.mark(this.findings.marks(this.frame));
  }

  /** Go to the nearest anomaly or alarm before (-1) or after (1) this tick. */
  async toAnomaly(way) {
    const { player } = this.time;
    const { back, on } = (await ask("beside", { tick: player.tick }).catch(said)) ?? {};
    const tick = way > 0 ? on : back;
    if (tick) {
      player.seek(tick);
      return;
    }
    this.voice.tell(`no anomaly or alarm ${way > 0 ? "after" : "before"} this tick`);
    flash(find(way > 0 ? "anomaly-on" : "anomaly-back"), way > 0 ? "no later" : "no earlier");
  }

  /** Offer ticks to go to; one that cannot be gone to says why. */
  async offerTicks() {
    const { frame, findings: { listed } } = this;
    const { day, week, done } = (frame && (await ask("beside", { tick: frame.tick }).catch(said))) || {};
    const why = frame?.at ? (done ? "the recording begins later" : "not read yet") : "this tick has no clock";
    const offered = [
      ["Last finding", listed[0]?.tick, "none so far"],
      ["24 h before", day, why],
      ["A week before", week, why],
      ["New since 24 h before", day, why, () => this.compare.withTick(day)],
    ].map(([text, tick, reason, act = () => this.time.player.seek(tick)]) => {
      const go = () => tick && [find("goto-list").hidePopover(), act()];
      const button = link(`${text}: ${tick ? `tick ${tick}` : reason}`, go, "");
      if (!tick) button.ariaDisabled = "true";
      return button;
    });
    find("goto-list").replaceChildren(...offered);
    const isOpen = () => find("goto-list").matches(":popover-open");
    if (done === false) setTimeout(() => isOpen() && this.offerTicks(), AGAIN);
  }

  /** Go to the tick of a wave, and play it. */
  async playWave({ tick, wave }) {
    this.time.player.pause();
    this.time.player.seek(tick);
    if (!(await this.frameCache.at(tick).catch(said))) return; // said where it was asked
    this.move();
    this.wave.play(wave);
  }

  /** Say what was learned between the ends of the range. */
  compareRange() {
    const [from, to] = this.time.range.shown;
    this.time.player.seek(to);
    this.compare.withTick(from);
  }

  showWords() {
    const { playing } = this.time.player;
    const reasons = this.reasons();
    this.outline.show(this.frame, reasons, playing);
    this.choice.show(this.frame, this.order.graph, playing, reasons);
  }

  /** Why each sensor is believed at the tick that is shown. */
  reasons() {
    return new Reasons(this.names, this.frame, this.order.graphOf(this.frame), this.growth);
  }

  changeWave() {
    keepWave(this.wave.which);
    this.showDiagram();
  }

  showDiagram() {
    if (this.frame === null) return;
    this.order.paint(this.frame, this.wave.shown);
    this.showWave();
  }

  /** Say which wave is on its way over the diagram. */
  showWave() {
    const label = find("drawing-wave");
    label.hidden = this.wave.shown === null;
    label.classList.toggle("imagined", this.wave.imagined);
    write(label, this.wave.name);
    this.depths.show(this.frame.height, this.wave.wave);
  }

  // Selecting ------------------------------------------------------------------------

  choose(thing) {
    keepChoice(thing, this.names);
    this.order.choose(thing);
    this.choice.choose(thing, this.frame, this.order.graph, this.frame && this.reasons());
  }

  /** Select a thing that is named somewhere, and bring it into view. */
  pick(thing) {
    if (thing.sensor !== undefined) this.goTo(thing.sensor);
    else this.choose(thing);
  }

  goTo(sensor) {
    this.choose({ sensor });
    this.order.diagram.reveal(sensor);
  }

  // A run under way ------------------------------------------------------------------

  /** Say what the run is, and between which ticks one can move. */
  setRun(run) {
    this.run = run;
    const { log, live, cut, first, ticks } = run;
    document.title = `${log} · neurosnap`;
    this.showWhat();
    this.live ||= live;
    find("badge").hidden = !this.live;
    find("badge").classList.toggle("over", !live);
    write(find("badge"), live ? "live" : `ended at tick ${ticks}`);
    find("follow").hidden = !live;
    say("empty", live || ticks >= first ? "" : "no tick was recorded");
    say("cut", cut === null ? "" : `This recording is not whole: ${cut}; what is here ends at tick ${ticks}`);
    this.frameCache.last = ticks;
    this.time.setEnds(first, ticks);
    this.growth.load().catch(said);
    this.findings.load().catch(said);
    this.depths.load().catch(said);
  }

  showWhat() {
    const { log, source, swarm } = this.run;
    write(find("what"), `${log} — ${source}, ${this.growth.words}, swarm ${swarm}`);
  }

  /** Something new has come: take it in after what came before. */
  receive(event) {
    const taken = this.received.then(() => (event.reset ? this.renew() : this.take(event)));
    this.received = taken.catch((error) => say("page", error.message));
  }

  /** It is another recording now. */
  async renew() {
    this.frameCache.clear();
    this.order.orders.clear();
    this.choose(this.order.chosen); // nothing is known of it any more
    this.setRun(await ask("run").catch(() => this.run));
  }

  /** Say what has become of the recording; null: it is there. */
  showTrouble(trouble) {
    if (this.run.live) return; // it may begin anew, and is then told of
    say("file", trouble ?? "");
    stopAsking(trouble);
  }

  /** Name whom a wave waits for; null: for no cell. */
  showWaiting(waiting) {
    const { cells, seconds } = waiting ?? { cells: [], seconds: 0 };
    const named = cells.slice(0, NAMED).flatMap(([first, last], k) => [
      k ? ", " : "waiting for ",
      link(first === last ? this.names[first] : `worker of ${this.names[first]} to ${this.names[last]}`, () => this.goTo(first)),
    ]);
    const more = cells.length > NAMED ? ` and ${cells.length - NAMED} more` : "";
    find("waiting").hidden = seconds < PATIENCE;
    find("waiting").replaceChildren(...named, make("span", { ariaHidden: true }, `${more} for ${seconds.toFixed(1)} s`));
  }

  take(event) {
    for (const frame of event.frames) this.frameCache.add(frame);
    const { ticks, live, cut } = event;
    this.setRun({ ...this.run, ticks, live, cut });
  }

  // Setting up -----------------------------------------------------------------------

  begin() {
    bind(this);
    explain();
    const asked = tickAsked();
    this.time.player.position = asked ?? Math.max(this.run.first, this.run.ticks);
    this.time.player.following = asked === null && this.run.live;
    this.opening = asked === null && !this.run.live;
    this.setRun(this.run);
    chooseRun().then((runs) => this.compare.offer(runs, runNumber), said);
    attend(({ trouble, waiting }) => {
      this.showTrouble(trouble);
      this.showWaiting(this.run.live ? waiting : null);
    });
    if (this.run.live) follow(openEvents, (event) => this.receive(event), sayLink);
  }

  /** A panel of the dock has come up. */
  open(panel) {
    this.panels += 1;
    if (panel === "compare") this.compare.open();
    if (panel === "raster") this.time.raster.open();
    if (panel === "sensors" && this.frame) this.showWords();
  }
}

async function open() {
  try {
    const page = new Page(await ask("run"));
    page.begin();
    return page;
  } catch (error) {
    say("page", error.message);
    throw error;
  }
}

export const page = await open();
