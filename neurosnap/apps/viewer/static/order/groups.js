// What is drawn as one: a sensor, a class of equivalent sensors, or a whole layer. An
// order too large to be looked at collapses, first its classes and then its layers, and
// is expanded again where somebody wants to see more.

import { drawn, isComplement, sensorOf } from "../base/literals.js";

/** The most items that are drawn before anything collapses. */
export const MOST = 160;

const BANDS = 14; // layers are joined where there would be more: all can be read
const SMALLEST = 3; // a class of two is no easier to read as one

/**
 * Return what is drawn of a graph.
 *
 * @param {object} graph as the server gives it
 * @param {Set<string>} expanded the keys of what was opened
 * @param {number} most items before it collapses
 * @returns {{items: object[], links: object[], itemOf: object[]}} An item has a key, a
 *   kind ("sensor", "class" or "layer"), its sensors and its layer; a link its two items,
 *   its kind, and the edges it stands for.
 */
export function collapse(graph, expanded, most) {
  const isLarge = graph.nodes.length > most;
  const items = isLarge
    ? byLayer(byClass(graph.nodes, expanded), expanded, most)
    : graph.nodes.map(single);
  const itemOf = [];
  for (const item of items) for (const sensor of item.sensors) itemOf[sensor] = item;
  return { items, links: joined(graph, itemOf), itemOf };
}

const classOf = (node) => sensorOf(node.class); // a literal's and its complement's are one

function single(node) {
  return {
    key: `s${node.sensor}`,
    kind: "sensor",
    sensors: [node.sensor],
    layer: node.layer,
    name: node.name,
    class: classOf(node),
    turned: isComplement(node.class), // it is the complement that stands in its class
  };
}

function byClass(nodes, expanded) {
  const items = [];
  for (const [number, members] of Map.groupBy(nodes, classOf)) {
    const key = `c${number}`;
    if (members.length < SMALLEST || expanded.has(key)) {
      items.push(...members.map(single));
      continue;
    }
    items.push({
      key,
      kind: "class",
      sensors: members.map((node) => node.sensor),
      layer: members[0].layer,
      name: `${members[0].name} ≡ ${members.length - 1} more`,
      class: number,
    });
  }
  return items;
}

function byLayer(items, expanded, most) {
  if (items.length <= most) return items;
  const highest = Math.max(...items.map((item) => item.layer));
  const step = Math.ceil((highest + 1) / BANDS);
  const kept = [];
  const bandOf = (item) => Math.floor(item.layer / step);
  for (const [band, members] of Map.groupBy(items, bandOf)) {
    const key = `l${band}`;
    if (members.length === 1 || expanded.has(key)) {
      kept.push(...members);
      continue;
    }
    const sensors = members.flatMap((item) => item.sensors);
    const [low, high] = [band * step, Math.min(band * step + step - 1, highest)];
    const layers = low === high ? `layer ${low}` : `layers ${low}–${high}`;
    kept.push({
      key,
      kind: "layer",
      sensors,
      layer: low,
      name: `${layers} · ${sensors.length} sensors`,
      class: -1,
    });
  }
  return kept;
}

function joined(graph, itemOf) {
  const links = new Map();
  for (const edge of graph.edges) {
    const one = drawn(edge.source, edge.target);
    const [from, to] = [itemOf[sensorOf(one.source)], itemOf[sensorOf(one.target)]];
    if (from === to) continue;
    // A literal of a sensor is a place of its own; one of a summary is not.
    const ends = [place(from, one.source), place(to, one.target), one.kind].join();
    if (!links.has(ends)) links.set(ends, { from, to, kind: one.kind, edges: [] });
    links.get(ends).edges.push(one);
  }
  return [...links.values()];
}

const place = (item, literal) => (item.kind === "sensor" ? literal : item.key);
