// Follows a live run: its news, whether the server is there, and which recording is shown.

import { keep, told } from "../base/address.js";
import { ask, run } from "../base/api.js";
import { find, make, write } from "../base/dom.js";

/**
 * Listen until the run has ended.
 *
 * The server that answers anew does not know what was sent before: it may have another
 * recording by then. So a link that is back counts as a reset.
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

// Whether the server is there, and the recording: asked for as long as the page is seen.
// Not by a stream: a browser has six connections to a server, for all its tabs together.

const EVERY = 2000; // milliseconds

/** Ask again and again; `onPresence` is told what has become of the recording. */
export function attend(onPresence) {
  setInterval(() => {
    if (!document.hidden) ask("presence").then(onPresence, () => {});
  }, EVERY);
}

// Which of the server's recordings is looked at: one is chosen in the head of the page, and
// the page is opened anew with it.

/** Show the recordings there are, where there are several; return them. */
export async function chooseRun() {
  const { runs } = await ask("runs");
  const choice = find("run");
  choice.hidden = runs.length < 2;
  choice.replaceChildren(
    ...runs.map(({ name, live }, number) =>
      make("option", { value: number }, live ? `${name} (live)` : name),
    ),
  );
  choice.value = run;
  choice.addEventListener("change", () => {
    keep({ run: choice.value === "0" ? null : choice.value });
    location.reload();
  });
  addEventListener("hashchange", () => {
    if ((told().get("run") ?? "0") !== run) location.reload();
  });
  return runs;
}

// Says that what is shown is not what was asked for: it is being read, or cannot be.

const PATIENCE = 150; // milliseconds that pass for at once

/** The sign over the diagram. */
export class Lateness {
  /** A tick is asked for, while another is shown; null: none is. */
  wait(asked, shown) {
    clearTimeout(this._timer);
    const still = shown === null ? "" : `; this is tick ${shown}`;
    this._timer = setTimeout(() => this._say(`reading tick ${asked}${still}`, true), PATIENCE);
  }

  /** A tick that was asked for is not to be had, and another is still shown. */
  miss(asked, shown) {
    clearTimeout(this._timer);
    if (shown === null || shown === asked) this.end();
    else this._say(`this is tick ${shown}, not tick ${asked}`, false);
  }

  /** What is shown is what was asked for. */
  end() {
    clearTimeout(this._timer);
    this._say("", false);
  }

  _say(text, isBusy) {
    write(find("late"), text);
    find("late").hidden = text === "";
    find("late").classList.toggle("busy", isBusy);
    document.body.classList.toggle("late", text !== "");
  }
}
