// The layered layout of an order: which items are drawn, and where.
// Layers go by height, what is implied above what implies it. Within a layer the order follows
// the neighbours' middles (Sugiyama's barycentres), and the places are the nearest to those
// middles that keep everything apart. All of it follows from the order alone, so a tick looks
// the same from wherever it was reached.

import { drawn, isComplement, sensorOf } from "../base/literals.js";

/** How high an item is drawn. */
export const HEIGHT = 20;

const GAP = 11; // beside an item
const WIDEST_GAP = 60; // between what stands left of a column and what stands right
const ROW = 27; // from one row of a layer to the next
const LAYER = 34; // from one layer to the next
const NARROWEST = 500; // of a layer that is divided into rows
const SWEEPS = 8;
const SPREAD = 40; // from one sensor to the next, before anything is settled
const ASPECT = 2; // how much wider than high the whole is made, if it can be

/**
 * Return what is drawn of a graph.
 *
 * @param {object} graph as the server gives it
 * @returns {{items: object[], links: object[]}} An item for each sensor; a link has its two
 *   items, the edge it is drawn for, and its kind.
 */
export function drawingOf(graph) {
  const items = graph.nodes.map((node) => ({
    sensor: node.sensor,
    layer: node.layer,
    name: node.name,
    tested: node.tested,
    class: sensorOf(node.class), // a literal's and its complement's are one
    turned: isComplement(node.class), // it is the complement that stands in its class
  }));
  const itemOf = new Map(items.map((item) => [item.sensor, item]));
  const links = graph.edges.map(({ source, target, tested }) => {
    const edge = drawn(source, target);
    const [from, to] = [edge.source, edge.target].map((end) => itemOf.get(sensorOf(end)));
    return { from, to, edge, kind: edge.kind, tested };
  });
  return { items, links };
}

/**
 * Place items.
 *
 * @param {object[]} items with `layer` and `class`
 * @param {object[]} links with `from` and `to`
 * @param {(item: object) => number} widthOf how wide an item is drawn
 * @returns {{places: Map<string, object>, bands: object[], box: object}} the middle and
 *   width of every item by sensor, what each layer takes up, and the box around all.
 */
export function layOut(items, links, widthOf) {
  const near = neighbours(items, links);
  const mates = matesOf(items, near);
  const places = new Map();
  for (const [rank, item] of items.entries()) {
    // Where nothing else says where to begin, the number does: so little moves when the
    // order changes a little.
    const x = SPREAD * rank;
    places.set(item.sensor, { x, y: 0, width: widthOf(item), item });
  }
  const layers = rows(items, near, places);
  for (let sweep = 0; sweep < SWEEPS; sweep += 1) {
    const turned = sweep % 2 ? [...layers].reverse() : layers;
    for (const layer of turned) {
      for (const row of layer.rows) settle(row, near, mates, places);
    }
  }
  centre(layers, near, mates, places);
  squeeze(places);
  const bands = stack(layers, places);
  lean(layers, bands, places);
  return { places, bands, box: around(places, bands) };
}

function neighbours(items, links) {
  const near = new Map(items.map((item) => [item.sensor, []]));
  for (const { from, to } of links) {
    near.get(from.sensor).push(to.sensor);
    near.get(to.sensor).push(from.sensor);
  }
  return near;
}

/** Of each item without neighbours, those of its class that have some. */
function matesOf(items, near) {
  const isLinked = ({ sensor }) => near.get(sensor).length > 0;
  const linked = Map.groupBy(items.filter(isLinked), (item) => item.class);
  const others = items.filter((item) => !isLinked(item));
  return new Map(others.map((item) => [item.sensor, (linked.get(item.class) ?? []).map(({ sensor }) => sensor)]));
}

/** Divide each layer into rows; classes without any neighbour are out of the way above. */
function rows(items, near, places) {
  const found = Map.groupBy(items, (item) => item.layer);
  const widest = bestWidth([...found.values()], places);
  const layers = [...found].sort(([a], [b]) => a - b);
  return layers.map(([layer, members]) => {
    members.sort((a, b) => a.sensor - b.sensor);
    const joined = new Set(
      members.filter((item) => near.get(item.sensor).length > 0).map((item) => item.class),
    );
    const linked = members.filter((item) => joined.has(item.class));
    const alone = members.filter((item) => !joined.has(item.class));
    return { layer, rows: [...split(alone, places, widest), ...split(linked, places, widest)] };
  });
}

/** The width of rows at which the whole is seen largest: not too wide, and not too high. */
function bestWidth(layers, places) {
  const widths = layers.map((members) =>
    members.reduce((sum, item) => sum + places.get(item.sensor).width + GAP, 0),
  );
  const size = (width) => {
    const high = widths.reduce((sum, all) => sum + LAYER + ROW * (Math.ceil(all / width) - 1), 0);
    return Math.min(ASPECT / Math.min(width, Math.max(...widths)), 1 / high);
  };
  const tried = Array.from({ length: 24 }, (_, k) => NARROWEST * 1.15 ** k);
  return tried.reduce((best, width) => (size(width) > size(best) ? width : best));
}

function split(members, places, widest) {
  const found = [];
  let used = Infinity;
  for (const item of members) {
    const width = places.get(item.sensor).width + GAP;
    if (used + width > widest) {
      found.push([]);
      used = 0;
    }
    found.at(-1).push(item);
    used += width;
  }
  return found;
}

/** Order a row by its neighbours' middles, and put it as near to them as it fits. */
function settle(row, near, mates, places) {
  const wanted = new Map();
  const middles = new Map();
  const middleOf = (sensors) => average(sensors.map((sensor) => places.get(sensor).x));
  // The members of a class stay together, in the middle of where they want to be. Those
  // without neighbours want to be with the others, in this row or another, or else where
  // they are.
  for (const [number, members] of Map.groupBy(row, (item) => item.class)) {
    const linked = members.filter((item) => near.get(item.sensor).length > 0);
    for (const item of linked) {
      wanted.set(item.sensor, middleOf(near.get(item.sensor)));
    }
    const own = linked.map((item) => wanted.get(item.sensor));
    const away = members.flatMap((item) => mates.get(item.sensor) ?? []);
    const keys = away.length ? away : members.map((item) => item.sensor);
    const middle = own.length ? average(own) : middleOf(keys);
    for (const item of members) if (!wanted.has(item.sensor)) wanted.set(item.sensor, middle);
    middles.set(number, average(members.map((item) => wanted.get(item.sensor))));
  }
  const middle = (item) => middles.get(item.class);
  row.sort((a, b) => middle(a) - middle(b) || a.class - b.class || a.sensor - b.sensor);
  apart(row, wanted, places);
}

/** Put rows that nothing ties to others in the middle of those that are tied. */
function centre(layers, near, mates, places) {
  const isTied = ({ sensor }) => near.get(sensor).length > 0 || mates.get(sensor).length > 0;
  const all = layers.flatMap((layer) => layer.rows);
  const [tied, free] = [all.filter((row) => isTied(row[0])), all.filter((row) => !isTied(row[0]))];
  if (tied.length === 0) return;
  const middleOf = (some) => {
    const ends = some.map(({ sensor }) => places.get(sensor));
    const left = Math.min(...ends.map(({ x, width }) => x - width / 2));
    return (left + Math.max(...ends.map(({ x, width }) => x + width / 2))) / 2;
  };
  const middle = middleOf(tied.flat());
  for (const row of free) {
    const by = middle - middleOf(row);
    for (const { sensor } of row) places.get(sensor).x += by;
  }
}

/** Take away the columns in which nothing stands: what is far from the rest comes near. */
function squeeze(places) {
  const left = ({ x, width }) => x - width / 2;
  const all = [...places.values()].sort((a, b) => left(a) - left(b));
  if (all.length === 0) return;
  let end = left(all[0]); // of what was placed
  let by = 0; // how far what is to be placed moves
  for (const place of all) {
    by += Math.max(0, left(place) - by - end - WIDEST_GAP);
    place.x -= by;
    end = Math.max(end, place.x + place.width / 2);
  }
}

const average = (numbers) => numbers.reduce((sum, one) => sum + one, 0) / numbers.length;

/**
 * Give a row the places that are nearest to those wanted, in square, and do not overlap:
 * pool what would, and share the mean (the pool adjacent violators algorithm).
 */
function apart(row, wanted, places) {
  const pools = [];
  let offset = 0;
  for (const item of row) {
    const { width } = places.get(item.sensor);
    offset += width / 2;
    pools.push({ sum: wanted.get(item.sensor) - offset, count: 1, members: [[item.sensor, offset]] });
    offset += width / 2 + GAP;
    while (pools.length > 1 && mean(pools.at(-1)) < mean(pools.at(-2))) {
      const last = pools.pop();
      const into = pools.at(-1);
      into.sum += last.sum;
      into.count += last.count;
      into.members.push(...last.members);
    }
  }
  for (const pool of pools) {
    for (const [sensor, at] of pool.members) places.get(sensor).x = mean(pool) + at;
  }
}

const mean = (pool) => pool.sum / pool.count;

/** Give every row its height on the page: layer 0, which implies nothing, on top. */
function stack(layers, places) {
  let y = 0;
  return layers.map(({ layer, rows: within }) => {
    const top = y - LAYER / 2;
    within.forEach((row, number) => {
      for (const item of row) places.get(item.sensor).y = y + number * ROW;
    });
    y += (within.length - 1) * ROW + LAYER;
    return { layer, top, bottom: y - LAYER / 2 };
  });
}

/** Let a high and narrow order lean to one side: a chain is read better as stairs. */
function lean(layers, bands, places) {
  const high = bands.length ? bands.at(-1).bottom - bands[0].top : 0;
  const box = around(places, bands);
  const spare = high * ASPECT - (box.right - box.left);
  if (spare <= 0 || layers.length < 3) return;
  const step = Math.min(spare / layers.length, 60);
  layers.forEach(({ rows: within }, number) => {
    for (const row of within) {
      for (const item of row) places.get(item.sensor).x -= step * number;
    }
  });
}

function around(places, bands) {
  if (places.size === 0) return { left: 0, right: 1, top: 0, bottom: 1 };
  const all = [...places.values()];
  return {
    left: Math.min(...all.map(({ x, width }) => x - width / 2)),
    right: Math.max(...all.map(({ x, width }) => x + width / 2)),
    top: bands[0].top,
    bottom: bands.at(-1).bottom,
  };
}
