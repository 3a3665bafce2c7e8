// The page: who is told what. Everything shown follows from the player's position; this
// is where a position becomes a frame, and a frame goes to all that show it.

import { tickAsked, told } from "./base/address.js";
import * as api from "./base/api.js";
import { counted, find, flash, write } from "./base/dom.js";
import { choiceAsked, keepChoice, keepView, keepWave, viewAsked, waveAsked } from "./base/link.js";
import { explain } from "./base/terms.js";
import { OrderChanges } from "./order/changes.js";
import { Diagram } from "./order/diagram.js";
import { Focus } from "./order/focus.js";
import { Orders } from "./order/orders.js";
import { Search } from "./order/search.js";
import { showCells } from "./run/cells.js";
import { FrameCache } from "./run/frames.js";
import { GrowthView } from "./run/growth.js";
import { HealthView } from "./run/health.js";
import { Lateness } from "./run/late.js";
import { follow, patched } from "./run/live.js";
import { attend } from "./run/presence.js";
import { chooseRun } from "./run/runs.js";
import { AlarmCard } from "./tick/alarms.js";
import { AnomalyCard } from "./tick/anomaly.js";
import { Reasons, tellItem } from "./tick/belief.js";
import { ChoiceView } from "./tick/choice.js";
import { FactsView } from "./tick/facts.js";
import { deepTick } from "./tick/first_view.js";
import { ImageView } from "./tick/image.js";
import { Outline } from "./tick/outline.js";
import { Notices, Voice } from "./tick/voice.js";
import { WaveView } from "./tick/wave.js";
import { WorldView } from "./tick/world.js";
import { CompareView } from "./time/compare.js";
import { Player } from "./time/player.js";
import { Plots } from "./time/plots.js";
import { TickRange } from "./time/range.js";
import { RasterView } from "./time/raster.js";
import { Strip } from "./time/strip.js";
import { Timeline } from "./time/timeline.js";
import { bind } from "./keys.js";

const RARELY = 100; // milliseconds between two orders while it plays
const SLOW = 2; // ticks a second up to which a tick's wave is shown on its way

const notices = new Notices();
const fetchRun = notices.watched("run", api.fetchRun);
const fetchFrames = notices.watched("frames", api.fetchFrames);
const fetchGraph = notices.watched("graph", api.fetchGraph);
const fetchSeries = notices.watched("series", api.fetchSeries);
const fetchBirths = notices.watched("births", api.fetchBirths);
const fetchHealth = notices.watched("health", api.fetchHealth);
const fetchMarks = notices.watched("marks", api.fetchMarks);
const fetchBeside = notices.watched("marks", api.fetchBeside);
const fetchRaster = notices.watched("raster", api.fetchRaster);
const fetchPresence = notices.watched("presence", api.fetchPresence);
const fetchCells = notices.watched("cells", api.fetchCells);
const comparing = {
  fetchPartings: notices.watched("compare", api.fetchPartings),
  fetchDifference: api.fetchDifference,
  fetchSeries,
  fetchSeriesOf: api.fetchSeriesOf,
};
const said = () => {}; // what failed was said where it was asked

/** Everything there is on the page of one run. */
class Page {
  constructor(run) {
    this.run = run;
    this.chosen = null;
    this.frame = null;
    this.late = new Lateness();
    this.graph = null;
    this.played = false;
    this.arranged = 0; // when an order was last shown
    this.live = false; // the run was seen under way
    this.received = Promise.resolve(); // once all that came has been taken in
    const names = [...run.sensors]; // what is grown gets its name later
    this.names = names;
    this.growth = new GrowthView(run, {
      fetchBirths,
      seek: (tick) => this.player.seek(tick),
      pick: (sensor) => this.goTo(sensor),
      change: () => this.learnBirths(),
    });
    this.health = new HealthView(run, fetchHealth);
    this.frameCache = new FrameCache(fetchFrames);
    this.orders = new Orders(fetchGraph);
    this.player = new Player({
      ready: (tick) => this.isReady(tick),
      move: () => this.move(),
      change: () => this.timeline.showPlayer(),
    });
    this.timeline = new Timeline(this.player);
    const range = (from, to) => this.range.set([from, to]);
    this.strip = new Strip({
      fetchMarks,
      seek: (tick) => this.player.seek(tick),
      range,
      alarms: (raised) => this.alarms.know(raised),
    });
    this.anomaly = new AnomalyCard(names, (thing) => this.pick(thing));
    this.alarms = new AlarmCard(names, (thing) => this.pick(thing));
    this.diagram = new Diagram(find("drawing"), {
      pick: (thing) => this.choose(thing),
      change: () => this.describe(),
      alone: () => this.focus.layOut(true),
      aim: () => keepView(this.diagram.view),
      tell: (item) => tellItem(item, this.reasons()),
    });
    this.focus = new Focus({
      isGrown: (sensor) => this.growth.of(sensor) !== undefined,
      change: () => this.refocus(),
    });
    this.wave = new WaveView({ names, actions: run.actions, change: () => this.changeWave() });
    this.changes = new OrderChanges(api.run, api.fetchDifference);
    this.facts = new FactsView(names, run);
    this.world = new WorldView(run.world);
    this.image = new ImageView(run);
    this.voice = new Voice(names);
    this.outline = new Outline(find("sensors"), names, this.growth, (sensor) =>
      this.goTo(sensor),
    );
    this.choice = new ChoiceView(names, this.growth, {
      pick: (thing) => this.choose(thing),
      fetchEdge: api.fetchEdge,
    });
    this.plots = new Plots(find("plots"), run.columns, {
      fetchSeries,
      seek: (tick) => this.player.seek(tick),
      range,
    });
    this.raster = new RasterView(names, {
      fetchRaster,
      seek: (tick) => this.player.seek(tick),
      pick: (sensor) => this.goTo(sensor),
    });
    this.compare = new CompareView(names, run, {
      ...comparing,
      seek: (tick) => this.player.seek(tick),
      range,
      pick: (thing) => this.pick(thing),
    });
    this.search = new Search(names, this.growth, {
      mark: (found) => this.diagram.seek(found),
      isGrown: (sensor) => this.growth.of(sensor) !== undefined,
      pick: (sensor) => this.goTo(sensor),
    });
    this.range = new TickRange(() => this.showRange());
  }

  // Moving through time --------------------------------------------------------------

  isReady(tick) {
    this.frameCache.prefetch(tick);
    if (this.frameCache.peek(tick) !== undefined) return true;
    this.frameCache.ask(tick);
    return false;
  }

  /** The player is somewhere else: show it, as soon as it is here. */
  move() {
    this.timeline.showTick();
    const { tick } = this.player;
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
        if (this.player.tick === tick) this.arrive(late);
      });
  }

  /** Show what there is of the tick one is at; null: it was not recorded. */
  arrive(frame) {
    document.body.ariaBusy = false;
    const missing = `tick ${this.player.tick} was not recorded`;
    notices.say("tick", frame === null ? missing : "");
    if (frame) {
      this.late.end();
      this.show(frame);
    } else {
      this.late.miss(this.player.tick, this.frame?.tick ?? null);
    }
  }

  show(frame) {
    const { playing, speed, position } = this.player;
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
    if (isFirst) this.restore();
  }

  /** Select what the link selects, and look where it looks. */
  restore() {
    const [choice, view, wave] = [choiceAsked(this.names), viewAsked(), waveAsked()];
    if (typeof choice === "string") notices.say("asked", `there is no ${choice} here`);
    else if (choice?.sensor !== undefined) this.goTo(choice.sensor);
    else if (choice) this.choose(choice);
    if (view) this.diagram.look(view);
    if (wave) this.wave.take(wave);
    else if (this.opensDeep) this.wave.openDeepest();
  }

  /** Show what stays the same as long as the tick does. */
  showTick() {
    const { frame } = this;
    this.showOrder();
    const before = this.frameCache.peek(frame.tick - 1);
    this.facts.show(frame, before);
    this.changes.show(frame, before, this.player.playing);
    this.search.show(frame);
    this.anomaly.show(frame);
    this.alarms.show(frame);
    this.world.show(frame);
    this.image.show(frame);
    this.plots.at(frame, this.player.playing);
    this.compare.show(frame, this.player.playing);
    this.raster.at(frame);
    this.voice.show(frame);
  }

  /** Show the learned order of the frame; while it plays, now and then. */
  showOrder() {
    const now = performance.now();
    const isDue = !this.player.playing || now - this.arranged >= RARELY;
    if (isDue) {
      this.arranged = now;
      const graph = this.orders.of(this.frame, (late) => this.showLate(late));
      if (graph) this.setGraph(graph);
    }
    this.showGraph();
  }

  /** Take over an order, and the names of the sensors in it. */
  setGraph(graph) {
    this.graph = graph;
    this.rename(graph.nodes);
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
    this.outline.rename();
    this.choice.rename();
    this.showWhat();
    if (this.frame) this.showTick();
  }

  /** Go to the nearest birth before (-1) or after (1) this tick. */
  toBirth(way) {
    const tick = this.growth.beside(this.player.tick, way);
    if (tick !== null) this.player.seek(tick);
  }

  /** Go to the nearest anomaly or alarm before (-1) or after (1) this tick. */
  async toAnomaly(way) {
    const tick = await fetchBeside(this.player.tick, way).catch(said);
    if (tick) {
      this.player.seek(tick);
      return;
    }
    this.voice.tell(`no anomaly or alarm ${way > 0 ? "after" : "before"} this tick`);
    flash(find(way > 0 ? "anomaly-on" : "anomaly-back"), way > 0 ? "no later" : "no earlier");
  }

  /** Say what was learned between the ends of the range. */
  compareRange() {
    const [from, to] = this.range.shown;
    this.player.seek(to);
    this.compare.withTick(from);
  }

  showLate(graph) {
    this.setGraph(graph);
    if (this.player.playing) this.showGraph();
    else this.showOrder(); // it may be of a tick before the one that was stopped at
  }

  showGraph() {
    const isMissing = this.graph?.id !== this.frame.graph && this.frame.graph !== "";
    find("drawing").ariaBusy = isMissing;
    this.refocus();
    this.showDiagram();
    this.describe();
    this.showWords();
  }

  showWords() {
    const reasons = this.reasons();
    this.outline.show(this.frame, reasons, this.player.playing);
    this.choice.show(this.frame, this.graph, this.player.playing, reasons);
  }

  /** Why each sensor is believed at the tick that is shown. */
  reasons() {
    const graph = this.graph?.id === this.frame.graph ? this.graph : null;
    return new Reasons(this.names, this.frame, graph);
  }

  changeWave() {
    keepWave(this.wave.which);
    this.showDiagram();
  }

  showDiagram() {
    if (this.frame === null) return;
    const calm = !this.player.playing || this.player.speed <= SLOW;
    this.diagram.show(this.graph, this.frame, this.wave.shown, calm);
    this.showWave();
    find("drawing").dataset.tick = this.frame.tick;
  }

  /** Say which wave is on its way over the diagram. */
  showWave() {
    const label = find("drawing-wave");
    label.hidden = this.wave.shown === null;
    label.classList.toggle("imagined", this.wave.imagined);
    write(label, this.wave.name);
  }

  /** Say what is drawn, for those who do not see it. */
  describe() {
    if (this.graph === null) return;
    const { items, sensors } = this.diagram.count;
    const { height, edges, classes } = this.graph;
    const all = this.graph.nodes.length;
    const part = sensors < all ? `, ${sensors} of them shown` : "";
    const few = part + (items < sensors ? `, drawn as ${items} items` : "");
    const late = find("drawing").ariaBusy === "true" ? `, as of tick ${this.graph.tick}` : "";
    const same = classes.reduce((sum, members) => sum + members.length - 1, 0);
    const counts = [
      counted(all, "sensor"),
      counted(edges.length, "covering edge"),
      counted(same, "equivalence"),
    ];
    const whole = `${counts.join(", ")}, height ${height}`;
    const facts = whole + few + late;
    write(find("diagram-facts"), facts);
    find("drawing").setAttribute("aria-label", `Hasse diagram: ${facts}`);
    find("drawing").dataset.items = items;
    find("expand").hidden = !this.diagram.isLarge;
  }

  // Selecting ------------------------------------------------------------------------

  choose(thing) {
    this.chosen = thing;
    keepChoice(thing, this.names);
    this.diagram.choose(thing);
    this.refocus();
    this.choice.choose(thing, this.frame, this.graph, this.frame && this.reasons());
  }

  /** Look at what is selected and filtered for. */
  refocus() {
    if (this.graph === null || this.frame === null) return;
    this.diagram.focus(this.focus.of(this.graph, this.frame, this.chosen));
    this.describe();
  }

  /** Select a thing that is named somewhere, and bring it into view. */
  pick(thing) {
    if (thing.sensor !== undefined) this.goTo(thing.sensor);
    else this.choose(thing);
  }

  goTo(sensor) {
    this.diagram.reveal(sensor);
    this.choose({ sensor });
  }

  expand() {
    this.all = !this.all;
    write(find("expand"), this.all ? "Collapse" : "Expand all");
    this.diagram.expandAll(this.all);
  }

  recolour() {
    this.diagram.recolour();
    this.plots.recolour();
    this.choice.recolour();
    this.compare.recolour();
    this.raster.recolour();
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
    notices.say("empty", live || ticks >= first ? "" : "no tick was recorded");
    notices.say("cut", cut === null ? "" : `This recording is not whole: ${cut}`);
    this.frameCache.last = ticks;
    this.player.setRange(first, ticks);
    this.range.setEnds(first, ticks);
    this.showRange();
    this.strip.load(first, ticks).catch(said);
    this.growth.load().catch(said);
    this.health.load().catch(said);
  }

  /** Show the ticks one looks at over time, and repeat them. */
  showRange() {
    const { shown, chosen } = this.range;
    this.player.range = chosen && shown;
    this.strip.choose(chosen);
    this.plots.load(...shown).catch(said);
    this.raster.load(...shown, chosen === null);
    this.compare.load(chosen);
  }

  showWhat() {
    const { log, source, swarm } = this.run;
    write(find("what"), `${log} — ${source}, ${this.growth.words}, swarm ${swarm}`);
  }

  /** Something new has come: take it in after what came before. */
  receive(event) {
    const taken = this.received.then(() => (event.reset ? this.renew() : this.take(event)));
    this.received = taken.catch((error) => notices.say("page", error.message));
  }

  /** It is another recording now. */
  async renew() {
    this.frameCache.clear();
    this.orders.clear();
    this.choose(this.chosen); // nothing is known of it any more
    this.setRun(await fetchRun().catch(() => this.run));
  }

  /** Say what has become of the recording; null: it is there. */
  showTrouble(trouble) {
    if (this.run.live) return; // it may begin anew, and is then told of
    notices.say("file", trouble ?? "");
    api.stopAsking(trouble);
  }

  take(event) {
    for (const change of event.frames) {
      const frame = patched(change, (tick) => this.frameCache.peek(tick));
      if (frame) this.frameCache.add(frame);
    }
    const { ticks, live, cut } = event;
    this.setRun({ ...this.run, ticks, live, cut });
  }

  // Setting up -----------------------------------------------------------------------

  async begin() {
    bind(this);
    explain();
    let asked = tickAsked();
    if (asked === null && !this.run.live && told().get("wave") === null) {
      asked = await deepTick(this.run, fetchFrames).catch(said);
      this.opensDeep = (asked ?? null) !== null;
    }
    asked ??= null;
    this.player.position = asked ?? this.run.first;
    this.player.following = asked === null && this.run.live;
    this.setRun(this.run);
    chooseRun().then((runs) => this.compare.offer(runs, api.run), said);
    attend(fetchPresence, (trouble) => this.showTrouble(trouble));
    if (this.run.live) {
      follow(
        api.openEvents,
        (event) => this.receive(event),
        (here) => notices.link(here),
      );
    }
  }

  /** A panel of the dock has come up. */
  open(panel) {
    if (panel === "compare") this.compare.open();
    if (panel === "raster") this.raster.open();
    if (panel === "sensors" && this.frame) this.showWords();
    if (panel !== "cells") return;
    fetchCells().then(
      (cells) => showCells(find("cells"), this.names, this.growth, cells),
      said,
    );
  }
}

async function open() {
  try {
    const page = new Page(await fetchRun());
    await page.begin();
    return page;
  } catch (error) {
    notices.say("page", error.message);
    throw error;
  }
}

export const page = await open();
