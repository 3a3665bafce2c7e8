// The edges of a sensor in groups, by what they say of it.

import { make } from "../base/dom.js";
import { drawn, isComplement, literalName, sensorOf } from "../base/literals.js";

const FEW = 6; // edges of a group that are listed before all are asked for

/** What an edge says of one of its two sensors. */
function groupOf({ source, target }, sensor) {
  if (isComplement(target)) return "excludes";
  if (isComplement(source)) return "one of the two is on";
  return sensorOf(source) === sensor ? "implies" : "implied by";
}

/**
 * List the edges of a sensor.
 *
 * @param {number} sensor
 * @param {object} graph
 * @param {string[]} names
 * @param {(edge: object) => void} pick
 * @returns {HTMLElement[]} a heading and a list for each group there is
 */
export function edgeList(sensor, graph, names, pick) {
  const own = graph.edges
    .map(({ source, target }) => drawn(source, target))
    .filter(({ source, target }) => sensorOf(source) === sensor || sensorOf(target) === sensor);
  const groups = Map.groupBy(own, (edge) => groupOf(edge, sensor));
  return [...groups].flatMap(([title, edges]) => group(title, edges, sensor, names, pick));
}

function group(title, edges, sensor, names, pick) {
  const list = make("ul", { className: "edges", ariaLabel: title });
  const add = (some) =>
    list.append(
      ...some.map((edge) => {
        const { source, target } = edge;
        const other = sensorOf(source) === sensor ? target : source;
        const whole = `${literalName(names, source)} → ${literalName(names, target)}`;
        const open = make(
          "button",
          { type: "button", className: "link", title: whole },
          names[sensorOf(other)],
        );
        open.addEventListener("click", () => pick(edge));
        return make("li", {}, open);
      }),
    );
  add(edges.slice(0, FEW));
  const heading = make("h3", {}, `${title} `, make("span", { className: "quiet" }, edges.length));
  if (edges.length <= FEW) return [heading, list];
  const more = make("button", { type: "button" }, `Show all ${edges.length}`);
  more.addEventListener("click", () => {
    more.remove();
    add(edges.slice(FEW));
    list.children[FEW].querySelector("button").focus();
  });
  return [heading, list, more];
}
