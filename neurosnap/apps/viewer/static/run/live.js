// A run that is under way: what is new comes as differences, and is put together again.

/**
 * Return the frame that a change leads to; undefined if what it changes is not known.
 *
 * @param {object} change as the server sends it
 * @param {(tick: number) => object|null|undefined} known the frame of a tick
 */
export function patched(change, known) {
  const { after, ...fields } = change;
  if (after === 0) {
    const values = (pairs) => pairs.map(([, value]) => value);
    return { ...fields, bits: values(fields.bits), state: values(fields.state) };
  }
  const before = known(after);
  if (!before) return undefined;
  const frame = { ...before, ...fields };
  for (const name of ["bits", "state"]) {
    frame[name] = [...before[name]];
    for (const [sensor, value] of fields[name] ?? []) frame[name][sensor] = value;
  }
  return frame;
}

/**
 * Listen until the run has ended.
 *
 * Whoever answers anew does not know what was told before: it may be another recording by
 * then. So a link that is back is told of as a reset.
 *
 * @param {() => EventSource} open
 * @param {(event: object) => void} onEvent
 * @param {(here: boolean) => void} onLink told when the server is lost, and is back
 */
export function follow(open, onEvent, onLink) {
  const stream = open();
  let lost = false;
  stream.addEventListener("open", () => {
    onLink(true);
    if (lost) onEvent({ reset: true });
    lost = false;
  });
  stream.addEventListener("error", () => {
    lost = true;
    onLink(false);
  });
  stream.addEventListener("message", (message) => {
    const event = JSON.parse(message.data);
    if (!event.live) stream.close(); // it would be opened again and again otherwise
    onEvent(event);
  });
}
