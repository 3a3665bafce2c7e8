// The lines between the items of the diagram: their routes and their styles.
// An excitatory line ends in an arrow, an inhibitory one is dashed and ends in a bar.
// The style sheet has the colours.

import { shape } from "../base/dom.js";
import { complementOf, drawn, isComplement, sensorOf } from "../base/literals.js";
import { HEIGHT } from "./layered_drawing.js";
import { CAP } from "./nodes.js";

/** Where on an item a literal is. */
function anchor(place, literal) {
  return isComplement(literal) ? place.x + place.width / 2 - CAP / 2 : place.x - CAP / 2;
}

/** The curve of a link: its four control points. */
function curve(link, places) {
  const [from, to] = [places.get(link.from.sensor), places.get(link.to.sensor)];
  const { source, target } = link.edge;
  const [x0, x3] = [anchor(from, source), anchor(to, target)];
  // A line within a row leaves it upwards, and comes back from there.
  const level = from.y === to.y;
  const up = level || to.y < from.y;
  const half = HEIGHT / 2;
  const y0 = from.y + (up ? -half : half);
  const y3 = to.y + (up && !level ? half : -half);
  const bend = level ? Math.min(14 + Math.abs(x3 - x0) / 14, 40) : Math.abs(y3 - y0) * 0.4;
  const out = up ? -bend : bend;
  return { x0, y0, x1: x0, y1: y0 + out, x2: x3, y2: level ? y3 - bend : y3 - out, x3, y3 };
}

/** A place on a curve, `t` of the way along. */
function along(c, t) {
  const s = 1 - t;
  const [a, b, d, e] = [s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t];
  return {
    x: a * c.x0 + b * c.x1 + d * c.x2 + e * c.x3,
    y: a * c.y0 + b * c.y1 + d * c.y2 + e * c.y3,
  };
}

/** The line of a link, and a wider one, which is not seen, to point at; one from before moves. */
export function lineOf(link, places, before) {
  const edge = `${link.edge.source}-${link.edge.target}`;
  const c = curve(link, places);
  const d = `M${c.x0} ${c.y0}C${c.x1} ${c.y1} ${c.x2} ${c.y2} ${c.x3} ${c.y3}`;
  let { line, d: old, link: last } = before.get(edge) ?? {};
  if (line === undefined) {
    line = shape("g", { "data-edge": edge });
    line.append(shape("path", { class: "near" }), shape("path", { class: "line" }));
  }
  if (link.tested !== last?.tested) line.style.setProperty("--wide", wideBy(link.tested));
  if (d !== old) for (const path of line.children) path.setAttribute("d", d);
  return { link, curve: c, line, d };
}

/** How wide a line is, by the occasions that tested its relation; as in the style sheet until these are known. */
const wideBy = (tested) => (tested === undefined ? "" : Math.min(0.8 + 0.7 * Math.log10(Math.max(tested, 1)), 3));

/** What lines end in. */
export function endsOf() {
  const ends = { excite: "M0 0L-8 -3.6V3.6z", inhibit: "M-2 -5V5" };
  return Object.entries(ends).map(([kind, d]) => {
    const end = shape("marker", { id: kind, orient: "auto", markerUnits: "userSpaceOnUse", overflow: "visible" });
    end.append(shape("path", { class: "end", d }));
    return end;
  });
}

// Pulses between one hop of a wave and the next, on their way along the lines: round ones
// excite, square ones inhibit.

/** Return the pulses that lead to what a wave reaches with its next hop. */
export function pulsesOf(lines, { hops, at }) {
  const [now, gone] = [Math.floor(at), at % 1];
  return lines.flatMap(({ link, curve: c }) => {
    const { source, target } = link.edge;
    // An edge's contrapositive runs against its line.
    const ways = [[source, target, gone], [complementOf(target), complementOf(source), 1 - gone]];
    const taken = ways.filter(([from, to]) => hops.get(from) === now && hops.get(to) === now + 1);
    return taken.map(([, to, share]) => {
      const { x, y } = along(c, share);
      return isComplement(to)
        ? shape("rect", { x: x - 4, y: y - 4, width: 8, height: 8 })
        : shape("circle", { cx: x, cy: y, r: 4.5 });
    });
  });
}

// What is wrong: a ring around each sensor at fault, and the rule that was broken, which the
// order may have lost by then.

const [AROUND, ABOVE] = [6, 10]; // pixels from a node to its ring, from a line to its words

/** Return the rings, and a line for each rule, a pair of literals. */
export function marksOf({ sensors, rules }, places) {
  const rings = sensors.filter((sensor) => places.has(sensor)).map((sensor) => {
    const { x, y, width } = places.get(sensor);
    const [wide, high] = [width + 2 * AROUND, HEIGHT + 2 * AROUND];
    return shape("rect", { class: "culprit", x: x - wide / 2, y: y - high / 2, width: wide, height: high, rx: high / 2 });
  });
  const lines = rules.map((rule) => drawn(...rule)).flatMap((edge) => {
    const [from, to] = [edge.source, edge.target].map((end) => ({ sensor: sensorOf(end) }));
    if (from.sensor === to.sensor || !places.has(from.sensor) || !places.has(to.sensor)) return [];
    const { line, curve: c } = lineOf({ from, to, edge }, places, new Map());
    const { x, y } = along(c, 0.5);
    const words = shape("text", { x, y: c.y0 === c.y3 ? y - ABOVE : y }); // or between two layers
    words.textContent = "broken here";
    line.setAttribute("class", "link broken");
    line.append(words);
    return [line];
  });
  return [...rings, ...lines]; // the words stay legible over a ring
}

// What lies behind the nodes: the layers as stripes, and what ties equivalent sensors
// together.

const FAR = 1e5; // beyond what is ever seen

/** The layers over the whole width, each with its number. */
export function stripesOf(bands, left) {
  return bands.flatMap(({ layer, top, bottom }, number) => {
    const text = shape("text", { class: "layer", x: left, y: (top + bottom) / 2 });
    text.textContent = layer;
    if (number % 2) return [text];
    return [shape("rect", { class: "band", x: -FAR, y: top, width: 2 * FAR, height: bottom - top }), text];
  });
}

/** A double line through the members of each class; crossed to a complement. */
export function tiesOf(places) {
  const found = [];
  for (const members of Map.groupBy(places.values(), ({ item }) => item.class).values()) {
    // Along each row, and from one row to the next where they begin.
    members.sort((a, b) => a.y - b.y || a.x - b.x);
    let first = members[0];
    for (let k = 1; k < members.length; k += 1) {
      const [one, other] = [members[k - 1], members[k]];
      const isLevel = one.y === other.y;
      const from = isLevel ? one : first;
      // Each was compared with what stands for their class.
      const tested = other.item.tested && Math.min(from.item.tested, other.item.tested);
      const line = shape("path", { class: tested === 0 ? "tie untested" : "tie", d: tie(from, other) });
      line.style.setProperty("--wide", wideBy(tested));
      found.push(line);
      if (!isLevel) first = other;
    }
  }
  return found;
}

function tie(one, other) {
  const [wide, high] = [other.x - one.x, other.y - one.y];
  const apart = 2.2 / Math.hypot(wide, high);
  const [across, down] = [high * apart, -wide * apart];
  const both = [-1, 1].map((side) => `M${one.x + side * across} ${one.y + side * down}l${wide} ${high}`);
  return both.join("") + (one.item.turned === other.item.turned ? "" : cross(one, other));
}

/** A stroke through a double line: one is equivalent to the complement of the other. */
function cross(one, other) {
  // In the middle of what is seen of it: the nodes lie above the line.
  const level = one.y === other.y;
  const shift = level ? (one.width - other.width) / 4 : 0;
  const [x, y] = [(one.x + other.x) / 2 + shift, (one.y + other.y) / 2];
  const [wide, high] = level ? [3, 7] : [7, 3];
  return `M${x - wide} ${y + high}l${2 * wide} ${-2 * high}`;
}
