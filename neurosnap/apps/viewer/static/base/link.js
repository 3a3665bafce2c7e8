// What a link brings besides its tick: what is selected, which wave, how near one looks.

import { keepSoon, told } from "./address.js";
import { drawn, sensorOf } from "./literals.js";

const PLACES = 4; // significant digits of where one looks

/** Keep in the address what is selected: a sensor by its name, an edge by its literals. */
export function keepChoice(thing, names) {
  const edge = thing?.edge ? `${thing.edge.source}-${thing.edge.target}` : null;
  const sensor = thing?.sensor === undefined ? null : names[thing.sensor];
  keepSoon({ sensor, edge });
}

/** Keep which wave is looked at; empty: the state's. */
export const keepWave = (which) => keepSoon({ wave: which || null });

/** Keep where one looks: the place in the middle and the scale; null: at all of it. */
export function keepView(view) {
  const digits = (value) => String(Number(value.toPrecision(PLACES)));
  keepSoon({ look: view && [view.x, view.y, view.scale].map(digits).join(",") });
}

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

/** Where the address says to look; null: it does not. */
export function viewAsked() {
  const values = (told().get("look") ?? "").split(",").map(Number);
  const isPlace = values.length === 3 && values.every(Number.isFinite) && values[2] > 0;
  return isPlace ? { x: values[0], y: values[1], scale: values[2] } : null;
}
