// Literals: sensor s has 2s, itself, and 2s + 1, its complement, written with a star.

export const sensorOf = (literal) => literal >> 1;
export const complementOf = (literal) => literal ^ 1;
export const isComplement = (literal) => (literal & 1) === 1;

/** What a literal is called. */
export const literalName = (names, literal) =>
  names[sensorOf(literal)] + (isComplement(literal) ? "*" : "");

/**
 * What an edge is drawn as. It and its contrapositive say the same; of the two the one
 * is drawn whose source is no complement, so that what implies stands below.
 */
export function drawn(source, target) {
  const turn = isComplement(source) && isComplement(target);
  const [from, to] = turn ? [complementOf(target), complementOf(source)] : [source, target];
  return { source: from, target: to, kind: isComplement(to) ? "inhibit" : "excite" };
}

/** Some names, and how many more there are. */
export function few(names, most, between = ", ") {
  const more = names.length - most;
  return names.slice(0, most).join(between) + (more > 0 ? ` and ${more} more` : "");
}

/** The word for a reading, or for what the state has of a sensor. */
export const bitWord = (bit) => (bit === null ? "unknown" : bit ? "on" : "off");

/** What the state has of each sensor of a frame: on, off, unknown or contradicted. */
export function conditions(frame) {
  const words = frame.state.map(bitWord);
  for (const sensor of frame.contradicted) words[sensor] = "contradicted";
  return words;
}
