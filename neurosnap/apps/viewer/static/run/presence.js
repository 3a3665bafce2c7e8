// Whether the server is there, and the recording: asked for as long as the page is seen.
// Not by a stream: a browser has six connections to a server, for all its tabs together.

const EVERY = 2000; // milliseconds

/**
 * Ask again and again.
 *
 * @param {() => Promise<object>} ask says itself if nobody answers
 * @param {(trouble: string|null) => void} onTrouble told what has become of the recording;
 *   null: it is there
 */
export function attend(ask, onTrouble) {
  setInterval(() => {
    if (!document.hidden) ask().then(({ trouble }) => onTrouble(trouble), () => {});
  }, EVERY);
}
