// What a drawing of the order is painted from, and how: behind, the lines; then the nodes;
// above them a wave on its way. The screen and a picture that is kept are painted alike.

import { sensorOf } from "../base/literals.js";
import { HEIGHT } from "./layered_drawing.js";
import { paintClasses, paintLink, paintPulses, paintStripes } from "./lines.js";
import { lookKey, looks } from "./nodes.js";

const RING = 5; // by how much what marks a node stands out

/**
 * @typedef {object} Scene
 * @property {object[]} bands the layers
 * @property {Map<number, object>} places where each item is drawn, by sensor
 * @property {Map<object, object>} curves of the links
 * @property {object[]} ways that pulses go
 * @property {object} frame
 * @property {{hops: Map<number, number>, at: number}|null} wave
 * @property {object|null} chosen `{sensor}` or `{edge}`
 * @property {Set<number>|null} sought the sensors a search has found
 * @property {{sensors: Set<number>|null, edges: Set<string>}} focus
 */

/**
 * @typedef {object} Sheet What is painted on.
 * @property {{scale: number, left: number, top: number}} camera
 * @property {number} width
 * @property {number} dots of the canvas for each unit of the width
 * @property {import("./nodes.js").NodePainter} painter
 */

/** Paint the layers, what ties equivalent sensors, and the edges. */
export function paintLines(context, scene, { camera, width, dots, painter: { colours } }) {
  context.setTransform(dots, 0, 0, dots, 0, 0);
  paintStripes(context, scene.bands, camera, width, colours);
  aim(context, camera, dots);
  const { focus, sought } = scene;
  if (focus.edges.has("same")) paintClasses(context, scene.places, colours);
  const isFar = ({ sensor }) => focus.sensors !== null && !focus.sensors.has(sensor);
  const isFaint = ({ from, to }) =>
    isFar(from) || isFar(to) || (sought !== null && !sought.has(from.sensor) && !sought.has(to.sensor));
  const chosen = [];
  for (const [link, c] of scene.curves) {
    if (!focus.edges.has(link.kind)) continue;
    if (isChosen(link, scene.chosen)) chosen.push([link, c]);
    else paintLink(context, link, c, colours, false, isFaint(link));
  }
  for (const [link, c] of chosen) paintLink(context, link, c, colours, true);
}

/**
 * Paint the nodes that look otherwise than before.
 *
 * @param {Map<number, string>|null} shown how each was painted last, by sensor; null: none was,
 *   and nothing is there to be wiped away
 */
export function paintNodes(context, scene, { camera, dots, painter }, shown = null) {
  aim(context, camera, dots);
  const { frame, wave, chosen, sought, focus } = scene;
  const lookOf = looks(frame, wave, chosen, sought, focus.sensors);
  for (const place of scene.places.values()) {
    const look = lookOf(place.item);
    if (shown !== null) {
      const key = lookKey(look);
      if (shown.get(place.item.sensor) === key) continue;
      shown.set(place.item.sensor, key);
      const [wide, high] = [place.width + 2 * RING, HEIGHT + 2 * RING];
      context.clearRect(place.x - wide / 2, place.y - high / 2, wide, high);
    }
    painter.paint(context, place, look, camera.scale);
  }
}

/** Paint the pulses of the wave. */
export function paintWave(context, { ways, curves, wave }, { camera, dots, painter }) {
  if (wave === null) return;
  aim(context, camera, dots);
  paintPulses(context, ways, curves, wave, painter.colours);
}

/** Paint in places of the drawing. */
function aim(context, { scale, left, top }, dots) {
  const by = scale * dots;
  context.setTransform(by, 0, 0, by, left * dots, top * dots);
}

function isChosen(link, chosen) {
  if (chosen === null) return false;
  const { sensor, edge } = chosen;
  const { source, target } = link.edge;
  if (edge) return edge.source === source && edge.target === target;
  return sensorOf(source) === sensor || sensorOf(target) === sensor;
}
