// The parts of the swarm: who they are, what they said, and where they run.

import { make } from "../base/dom.js";
import { few } from "../base/literals.js";

const SHOWN = 6; // sensors of a worker that are named

/** Show the parts of the swarm as a table. */
export function showCells(home, names, growth, { cells, read_to: readTo }) {
  // Parts that are no processes of their own have no place of their own.
  const isPlaced = cells.some(({ host }) => host !== null);
  const titles = [["Part"], ["Sensors"], ["Messages", "number"], ["Restarts", "number"]];
  if (isPlaced) titles.push(["Host"]);
  const head = titles.map(([title, className = ""]) =>
    make("th", { scope: "col", className }, title),
  );
  const rows = cells.map((cell) =>
    make(
      "tr",
      {},
      make("th", { scope: "row" }, cell.who),
      make("td", {}, hosted(cell.sensors, names, growth)),
      make("td", { className: "number" }, String(cell.messages)),
      make("td", { className: "number" }, String(cell.restarts)),
      ...(isPlaced ? [make("td", {}, cell.host ?? "not known")] : []),
    ),
  );
  const table = make(
    "table",
    {},
    make("caption", { className: "unseen" }, "The parts of the swarm"),
    make("thead", {}, make("tr", {}, ...head)),
    make("tbody", {}, ...rows),
  );
  const note = make("p", { className: "quiet" }, `Messages counted up to tick ${readTo}.`);
  home.replaceChildren(note, table);
}

/** The sensors that a part hosts, and the room it has for more. */
function hosted(sensors, names, growth) {
  const there = sensors.filter((sensor) => growth.isSensor(sensor));
  const room = sensors.length - there.length;
  const named = few(there.map((sensor) => names[sensor]), SHOWN);
  return [named, room ? `room for ${room} more` : ""].filter(Boolean).join("; ");
}
