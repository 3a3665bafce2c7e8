// The fragment of the page's address: the recording, the tick and what is selected.
// A link brings it; the rest of the address is the server's.

import { drawn, sensorOf } from "./literals.js";

const PATIENCE = 500; // milliseconds of rest before what changes often is written

let timer;
let waiting = {};

/** The names and values there are. */
export const told = () => new URLSearchParams(location.hash.slice(1));

/** Set some of them, null: they are not there; the others stay. */
export function keep(values) {
  const all = told();
  for (const [name, value] of Object.entries({ ...waiting, ...values })) {
    if (value === null) all.delete(name);
    else all.set(name, value);
  }
  clearTimeout(timer);
  waiting = {};
  const text = all.toString();
  if (text === location.hash.slice(1)) return;
  history.replaceState(null, "", location.pathname + location.search + (text && `#${text}`));
}

/** Set some once nothing changes any more: browsers refuse to have it written too often. */
export function keepSoon(values) {
  waiting = { ...waiting, ...values };
  clearTimeout(timer);
  timer = setTimeout(() => keep({}), PATIENCE);
}

/** The tick in the address; null if there is none. */
export function tickAsked() {
  const tick = told().get("t") ?? "";
  return /^\d+$/.test(tick) ? Number(tick) : null;
}

// What a link brings besides its tick: what is selected, and which wave.

/** Keep in the address what is selected: a sensor by its name, an edge by its literals. */
export function keepChoice(thing, names) {
  const edge = thing?.edge ? `${thing.edge.source}-${thing.edge.target}` : null;
  const sensor = thing?.sensor === undefined ? null : names[thing.sensor];
  keepSoon({ sensor, edge });
}

/** Keep which wave is looked at; empty: the state's. */
export const keepWave = (which) => keepSoon({ wave: which || null });

/** What the address says is selected; a text says why it cannot be. */
export function choiceAsked(names) {
  const [sensor, edge] = ["sensor", "edge"].map((name) => told().get(name));
  if (edge !== null) {
    const [, source, target] = /^(\d+)-(\d+)$/.exec(edge) ?? [];
    const isThere = [source, target].every((literal) => names[sensorOf(literal)] !== undefined);
    const isEdge = isThere && sensorOf(source) !== sensorOf(target);
    return isEdge ? { edge: drawn(Number(source), Number(target)) } : `edge ${edge}`;
  }
  if (sensor === null) return null;
  const found = names.indexOf(sensor);
  return found < 0 ? `sensor ${sensor}` : { sensor: found };
}

/** The wave in the address; null: it says none. */
export const waveAsked = () => told().get("wave");
