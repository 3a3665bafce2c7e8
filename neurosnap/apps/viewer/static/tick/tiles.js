// The tiles of a world, the walls between them, and what is on them. A place is one wide;
// whatever a colour says, a shape or a letter says too.

import { shape } from "../base/dom.js";

const LETTERS = {
  start: "S",
  goal: "G",
  red: "R",
  green: "G",
  yellow: "Y",
  blue: "B",
};
const TURNS = { north: 0, east: 90, south: 180, west: 270 };
const LIMIT = 0.46; // from a place's middle to its side

/** The tile at a place: its ground, and a sign on it. */
export function tileAt([x, y], tile) {
  const side = { x: x - LIMIT, y: y - LIMIT, width: 2 * LIMIT, height: 2 * LIMIT, rx: 0.06 };
  const parts = [shape("rect", { ...side, class: `place ${tile}` })];
  if (tile === "hole") parts.push(shape("circle", { cx: x, cy: y, r: 0.33, class: "sign" }));
  if (tile === "cliff") {
    const d = [-0.3, 0, 0.3].map((at) => `M${x + at - 0.14} ${y + 0.3}l0.28 -0.6`).join("");
    parts.push(shape("path", { d, class: "sign" }));
  }
  if (LETTERS[tile]) {
    const letter = shape("text", { x: x - 0.26, y: y - 0.2, class: "letter" });
    letter.textContent = LETTERS[tile];
    parts.push(letter);
  }
  return parts;
}

/** Where there is no place: a hole. */
export function holesOf({ width, height, coordinates }) {
  const there = new Set(coordinates.map(([x, y]) => y * width + x));
  const all = [...Array(width * height).keys()].filter((number) => !there.has(number));
  return all.map((number) => [number % width, Math.floor(number / width)]);
}

/** A wall between two neighbours. */
export function wallBetween([ax, ay], [bx, by]) {
  const [x, y] = [(ax + bx) / 2, (ay + by) / 2];
  const [dx, dy] = [(by - ay) / 2, (bx - ax) / 2]; // along it
  return shape("line", { x1: x - dx, y1: y - dy, x2: x + dx, y2: y + dy, class: "wall" });
}

const SIGNS = {
  passenger: () =>
    "M0 0.42a0.2 0.3 0 0 1 0.4 0zM0.2 0.08a0.14 0.14 0 1 0 -0.01 -0.28a0.14 0.14 0 0 0 0.01 0.28z",
  destination: () => "M-0.38 0.4V-0.1L0 0.06L-0.38 0.22",
  key: () => "M0.02 0a0.13 0.13 0 1 0 -0.26 0a0.13 0.13 0 1 0 0.26 0h0.26v0.12m-0.09 -0.12v0.09",
  door: (state) =>
    ({
      open: "M-0.4 -0.4V0.4M-0.4 0.4h0.14V-0.4h-0.14",
      closed: "M-0.4 -0.4h0.8v0.8h-0.8zM0.22 0a0.05 0.05 0 1 0 0.1 0a0.05 0.05 0 1 0 -0.1 0",
    })[state] ??
    "M-0.4 -0.4h0.8v0.8h-0.8zM-0.14 0h0.28v0.22h-0.28zM-0.09 0v-0.1a0.09 0.09 0 0 1 0.18 0v0.1",
};

/** What else there is, where it is; what is with the agent goes with it. */
export function signOf({ what, state }, [x, y]) {
  const d = (SIGNS[what] ?? (() => ""))(state);
  return shape("path", { d, transform: `translate(${x} ${y})`, class: `thing ${what}` });
}

/** The agent where it looks somewhere. */
export function arrowTo(heading, [x, y]) {
  const turn = `translate(${x} ${y}) rotate(${TURNS[heading]})`;
  return { d: "M0 -0.36L0.28 0.3L0 0.16L-0.28 0.3z", transform: turn };
}

/** Whether it is known which way this is. */
export const isWay = (heading) => heading in TURNS;
