// Questions to the server, and what is amiss with it.
// Addresses are relative to the page, so that it works wherever the server puts it.

import { told } from "./address.js";
import { find, write } from "./dom.js";

const GONE = "the server does not answer; has it been stopped?";

/** The number of the recording that is looked at; the address says it. */
export const run = told().get("run") ?? "0";

/** Where something is to be asked, of the recording that is looked at but for `query`. */
export function at(what, query = {}) {
  const search = new URLSearchParams({ ...(run === "0" ? {} : { run }), ...query }).toString();
  return `api/${what}${search && `?${search}`}`;
}

const amiss = new Map(); // said by several: none wipes away what another said

/** Say that something is amiss, in the name of `who`; nothing: it is no longer so. */
export function say(who, text) {
  if (text === (amiss.get(who) ?? "")) return;
  amiss.set(who, text);
  const all = [...new Set(amiss.values())].filter(Boolean).join(" · ");
  write(find("notice"), all);
  find("notice").title = all; // there may not be room for all of it
  find("notice").hidden = all === "";
  // What is shown is what was read before.
  const isOld = ["link", "file"].some((one) => amiss.get(one));
  document.body.classList.toggle("old", isOld);
}

/** Say whether the server is there, which every answer shows. */
export const sayLink = (here) => say("link", here ? "" : GONE);

let ended = null;

/** Ask no more, for a reason: what would be answered is of something else; null: do. */
export const stopAsking = (reason) => {
  ended = reason;
};

const OWN = ["difference", "edge", "runs"]; // what goes wrong is said where it is asked

// What takes long is named in the head of the page, until it is answered.

const PATIENCE = 300; // milliseconds that pass for at once
const SUBJECTS = {
  run: "the run", runs: "the recordings", presence: "whether the recording is there", frames: "",
  graph: "the order", tested: "the tests of the order", wave: "a wave", edge: "the weights of an edge", difference: "what differs",
  series: "the curves", raster: "the raster", marks: "what happened", beside: "where to go",
  births: "what was grown", findings: "the findings", depths: "the depths of waves",
};
const slow = new Map(); // what is named, by the timer of its question

/** Name a question that is not answered soon; return what ends that. */
function named(what, { tick, from = tick, to = from }) {
  const ticks = from === undefined ? "" : from === to ? `tick ${from}` : `ticks ${from} to ${to}`;
  const subject = [SUBJECTS[what], ticks].filter(Boolean).join(" at ");
  const show = () => {
    write(find("reading"), slow.size ? `reading ${[...new Set(slow.values())].join(", ")} …` : "");
    find("reading").hidden = slow.size === 0;
  };
  const timer = setTimeout(() => show(slow.set(timer, subject)), PATIENCE);
  return () => {
    clearTimeout(timer);
    if (slow.delete(timer)) show();
  };
}

/** Ask a question of `neurosnap/apps/viewer/api.py`, by its name; say what goes wrong. */
export async function ask(what, query = {}) {
  const answered = named(what, query);
  try {
    if (ended !== null && what !== "presence") throw new Error(ended);
    const response = await fetch(at(what, query)).catch(() => null);
    sayLink(response !== null);
    if (response === null) throw new Error(GONE);
    const answer = await response.json().catch(() => null);
    if (!response.ok || answer === null) throw new Error(answer?.error ?? `the server answered ${response.status}`);
    say(what, "");
    return answer;
  } catch (error) {
    if (error.message !== GONE && !OWN.includes(what)) say(what, error.message);
    throw error;
  } finally {
    answered();
  }
}

/** The stream of what is new in a recording that grows. */
export const openEvents = () => new EventSource(at("events"));

// What a server reads in the background: asked for again until all of it is there.

const AGAIN = 700; // milliseconds until it is asked for once more

/**
 * Return a function that asks for something until all of it is there, one question at a time;
 * its promise ends then. Called while it is asking, it asks once more.
 *
 * @param {() => Promise<boolean>} asks told to ask, and tells whether that was all
 */
export function gathering(asks) {
  let [going, isDue] = [null, false];
  const go = async () => {
    for (let done = false; !done || isDue; ) {
      isDue = false;
      done = await asks();
      if (!done || isDue) await new Promise((soon) => setTimeout(soon, AGAIN));
    }
  };
  return () => {
    isDue = true; // there may be more than was asked for
    return (going ??= go().finally(() => (going = null)));
  };
}
