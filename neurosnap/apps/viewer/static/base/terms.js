// The terms of the page: underlined words that show an explanation.
// It comes under the pointer, with the focus, or by a touch.

import { find, make } from "./dom.js";

const GAP = 6; // pixels between a word and its sentence

/** What each word means, in a sentence. */
const TERMS = {
  order: "What the memory has learned: an edge from a up to b says that whenever a is on, b is.",
  "covering edge": "An implication that does not follow from others by way of a third sensor. Only these are drawn.",
  equivalence: "Two sensors of which each implies the other: they have always been the same, on and off together.",
  opposite: "A sensor is equivalent to the complement of another: one has always been on where the other was off.",
  complement: "The other half of a sensor, written with a star: a* is on where a is off.",
  height: "The number of edges on the longest chain of implications. It limits how deep a wave can go.",
  layer: "How many edges the longest chain from a sensor upwards has. Layer 0 is at the top: it implies nothing more.",
  wave: "Cells that are on tell those that they imply, these tell the next, until none is new.",
  depth: "How many hops a wave took until its last cell was told.",
  longest: "The longest chain of implications that begins in what was read: the most hops that this wave could take.",
  pulses: "The messages that cells sent each other in a wave.",
  hop: "One step of a wave: from cells to all that these directly imply.",
  literal: "One of the two halves of a sensor: the sensor itself, or its complement, which is on where the sensor is off.",
  context: "A sensor such as up&door: on where the action up was taken and door was on before it. In such a name ~ means not.",
  occasion: "Ticks one after the other in which two sensors do not change count as one occasion: a lasting reading is no new evidence.",
  untested: "No occasion has tested it yet, as where two sensors have never changed. What is tested by more occasions has a wider line. A test is an occasion with the first on, and one with the second off; of these the fewer count.",
  "if on": "What the memory would believe of others if this sensor were on.",
  "if off": "What the memory would believe of others if this sensor were off.",
  read: "What the sensor itself said at this tick.",
  state: "What the memory holds to be true at this tick: on, off, unknown or contradicted.",
  belief: "Where a state comes from: it was read, or it is predicted by others, or readings contradict it.",
  on: "How many sensors the memory holds to be on.",
  predicted: "The sensor was not read, but others that were read imply its state.",
  contradicted: "What others imply of the sensor and what it reads cannot both be true, or others contradict each other about it: its state is left open.",
  unknown: "The sensor was not read, and nothing that was read implies its state.",
  excites: "Where the first is on, the second is on: a signal goes from the one to the other.",
  inhibits: "Where the first is on, the second is off.",
  did: "The action that was decided on at this tick. It shows in what is read at the next.",
  why: "Why this action was decided on.",
  plan: "The actions that the decision follows: this one in bold, and those to come.",
  grown: "Sensors that the memory has made for itself, out of an action and what was on before it.",
  "not read": "Sensors that gave no reading at this tick.",
  edges: "The implications that the cells use as wires. An edge and its contrapositive count as two.",
  anomaly: "An observation that contradicts what was learned before it.",
  implies: "What is on or off whenever this sensor is on.",
  threshold: "How seldom a must be seen with b off for a to imply b, as a share of all ticks.",
  finding: "A sensor that was at fault: anomalies in a row that begin with it, or an alarm.",
  imagined: "A wave that starts in a state the memory only imagines, some actions ahead, when it plans.",
};

/** A word that explains itself. */
export const term = (name, text = name) =>
  make("button", { type: "button", className: "term", "data-term": name }, text);

/** Explain words wherever they come to stand, and list all of them in the help. */
export function explain() {
  const tip = find("tip");
  let at = null;
  const hide = () => {
    at?.removeAttribute("aria-describedby");
    at = null;
    tip.hidden = true;
  };
  const show = (word) => {
    if (word === at) return;
    hide();
    at = word;
    tip.textContent = TERMS[word.dataset.term];
    tip.hidden = false;
    word.setAttribute("aria-describedby", "tip");
    const { left, top, bottom } = word.getBoundingClientRect();
    const { width, height } = tip.getBoundingClientRect();
    const below = bottom + GAP + height < innerHeight;
    tip.style.left = `${Math.max(GAP, Math.min(left, innerWidth - width - GAP))}px`;
    tip.style.top = `${below ? bottom + GAP : top - GAP - height}px`;
  };
  const follow = ({ target }) => {
    const word = target.closest?.(".term");
    // One may move onto the sentence, to read it at leisure.
    if (word) show(word);
    else if (target !== tip && document.activeElement !== at) hide();
  };
  for (const event of ["pointerover", "focusin", "click"]) document.addEventListener(event, follow);
  document.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape" || at === null) return;
      hide();
      event.stopPropagation(); // it means no more than that
    },
    { capture: true },
  );
  find("words-list").append(
    ...Object.entries(TERMS).flatMap(([name, says]) => [
      make("dt", {}, name),
      make("dd", {}, says),
    ]),
  );
}
