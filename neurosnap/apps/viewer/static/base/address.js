// What the page's address says behind its #: where one is in which recording, as names
// with values. It is what a link brings; the rest of the address is the server's.

const PATIENCE = 500; // milliseconds of rest before what changes often is written

let timer;
let waiting = {};

/** The names and values there are. */
export const told = () => new URLSearchParams(location.hash.slice(1));

/** Set some of them, null: they are not there; the others stay. */
export function keep(values) {
  const all = told();
  for (const [name, value] of Object.entries({ ...waiting, ...values })) {
    if (value === null) all.delete(name);
    else all.set(name, value);
  }
  clearTimeout(timer);
  waiting = {};
  const text = all.toString();
  if (text === location.hash.slice(1)) return;
  history.replaceState(null, "", location.pathname + location.search + (text && `#${text}`));
}

/** Set some once nothing changes any more: browsers refuse to have it written too often. */
export function keepSoon(values) {
  waiting = { ...waiting, ...values };
  clearTimeout(timer);
  timer = setTimeout(() => keep({}), PATIENCE);
}

/** The tick in the address; null if there is none. */
export function tickAsked() {
  const tick = told().get("t") ?? "";
  return /^\d+$/.test(tick) ? Number(tick) : null;
}
