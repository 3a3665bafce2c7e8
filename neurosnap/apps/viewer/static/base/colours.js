// The style sheet's colours, for what is painted by hand: one place says what they are.

const NAMES = [
  "bg", "panel", "ink", "mute", "line", "band", "accent", "bad", "first", "second", "third",
  "fourth",
];

/** The colours of the present scheme by name. */
export function palette() {
  // Only a property that takes colours has them worked out: light or dark.
  const probe = document.createElement("i");
  document.body.append(probe);
  const colours = {};
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return colours;
}

/** The font of what is painted, at a size in pixels. */
export const font = (size) => `${size}px system-ui, "Segoe UI", "DejaVu Sans", sans-serif`;
