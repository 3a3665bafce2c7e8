// What the server can be asked, one function a question. Addresses are relative to the
// page, so that it works wherever the server puts it.

/** What there is to say where nobody answers. */
export const GONE = "the server does not answer; has it been stopped?";

async function ask(what, query = {}, signal = undefined) {
  const search = new URLSearchParams(query).toString();
  const address = `api/${what}${search && `?${search}`}`;
  let response;
  try {
    response = await fetch(address, { signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error(GONE);
  }
  const answer = await response.json().catch(() => null);
  signal?.throwIfAborted(); // it may have been while the answer came
  if (response.ok && answer !== null) return answer;
  throw new Error(answer?.error ?? `the server answered ${response.status}`);
}

/** What is being looked at: sensors, ticks, world, columns. */
export const fetchRun = () => ask("run");

/** The frames of ticks `from` to `to`, both included, as far as there are any. */
export const fetchFrames = async (from, to) => (await ask("frames", { from, to })).frames;

/** The learned order after a tick. */
export const fetchGraph = (tick) => ask("graph", { tick });

/** The weights of an implication at a tick, and around it. */
export const fetchEdge = (source, target, tick, signal) =>
  ask("edge", { source, target, tick }, signal);

/** One column over ticks `from` to `to`, in about `points` points. */
export const fetchSeries = (column, from, to, points) =>
  ask("series", { column, from, to, points });

/** The sensors that were grown, as far as that was read. */
export const fetchBirths = () => ask("births");

/** Which sensors seem broken, as far as that was read. */
export const fetchHealth = () => ask("health");

/** What happened from tick `from` to `to`, in `bins` stretches, as far as that was read. */
export const fetchMarks = (from, to, bins) => ask("marks", { from, to, bins });

/** The tick of the nearest anomaly before (-1) or after (1) a tick; null: there is none. */
export const fetchBeside = async (tick, way) => (await ask("beside", { tick, way })).tick;

/** The parts of the swarm. */
export const fetchCells = () => ask("cells");

/** The stream of what is new in a recording that grows. */
export const openEvents = () => new EventSource("api/events");
