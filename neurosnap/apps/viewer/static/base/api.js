// Requests to the server: one function for each.
// Addresses are relative to the page, so that it works wherever the server puts it.

import { told } from "./address.js";

/** What is said where no answer comes. */
export const GONE = "the server does not answer; has it been stopped?";

/** The number of the recording that is looked at; the address says it. */
export const run = told().get("run") ?? "0";

/** Where something is to be asked, of the recording that is looked at but for `query`. */
export function at(what, query = {}) {
  const search = new URLSearchParams({ ...(run === "0" ? {} : { run }), ...query }).toString();
  return `api/${what}${search && `?${search}`}`;
}

let ended = null;

/** Ask no more, for a reason: what would be answered is of something else; null: do. */
export const stopAsking = (reason) => {
  ended = reason;
};

async function ask(what, query = {}) {
  if (ended !== null && what !== "presence") throw new Error(ended);
  const address = at(what, query);
  let response;
  try {
    response = await fetch(address);
  } catch {
    throw new Error(GONE);
  }
  const answer = await response.json().catch(() => null);
  if (response.ok && answer !== null) return answer;
  throw new Error(answer?.error ?? `the server answered ${response.status}`);
}

/** All recordings of this server, by their numbers. */
export const fetchRuns = async () => (await ask("runs")).runs;

/** What differs between a tick here and a tick in another recording, or in this. */
export const fetchDifference = (tick, other, then) => ask("difference", { tick, other, then });

/** What is being looked at: sensors, ticks, world. */
export const fetchRun = () => ask("run");

/** The frames of ticks `from` to `to`, both included, as far as there are any. */
export const fetchFrames = async (from, to) => (await ask("frames", { from, to })).frames;

/** A wave of a tick with its hops. */
export const fetchWave = (tick, wave) => ask("wave", { tick, wave });

/** The learned order after a tick. */
export const fetchGraph = (tick) => ask("graph", { tick });

/** The weights of an implication at a tick. */
export const fetchEdge = (source, target, tick) => ask("edge", { source, target, tick });

/** All columns over ticks `from` to `to`, in about `points` points each. */
export const fetchSeries = (from, to, points) => ask("series", { from, to, points });

/** The sensors that were grown, as far as that was read. */
export const fetchBirths = () => ask("births");

/** Which sensors were at fault, and when, as far as that was read. */
export const fetchFindings = () => ask("findings");

/** How many waves had which height and depth, as far as that was read. */
export const fetchDepths = () => ask("depths");

/** What sensors were at ticks: `from`, `to`, `columns`, `sensor`, `sensors`. */
export const fetchRaster = (query) => ask("raster", query);

/** What happened from tick `from` to `to`, in `bins` stretches, as far as that was read. */
export const fetchMarks = (from, to, bins) => ask("marks", { from, to, bins });

/** Which ticks to go to from one: an anomaly `back` or `on`, a `day` or a `week` before. */
export const fetchBeside = (tick) => ask("beside", { tick });

/** Whether the recording is still there. */
export const fetchPresence = () => ask("presence");

/** The stream of what is new in a recording that grows. */
export const openEvents = () => new EventSource(at("events"));

// What a server reads in the background: asked for again until all of it is there.

const AGAIN = 700; // milliseconds until it is asked for once more

/**
 * Return a function that asks for something until all of it is there, one question at a time;
 * its promise ends then. Called while it is asking, it asks once more.
 *
 * @param {() => Promise<boolean>} ask told to ask, and tells whether that was all
 */
export function gathering(ask) {
  let [going, isDue] = [null, false];
  const go = async () => {
    for (let done = false; !done || isDue; ) {
      isDue = false;
      done = await ask();
      if (!done || isDue) await new Promise((soon) => setTimeout(soon, AGAIN));
    }
  };
  return () => {
    isDue = true; // there may be more than was asked for
    return (going ??= go().finally(() => (going = null)));
  };
}
