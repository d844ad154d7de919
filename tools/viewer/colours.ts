/** Colours of isovalues: by value from dark violet to yellow (viridis of matplotlib), as in pictures. */

/** Red, green and blue, from 0 to 1. */
export type Colour = [number, number, number];

/** Viridis, in eighths. */
const STOPS = ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"].map((text) =>
  [0, 2, 4].map((i) => parseInt(text.slice(i, i + 2), 16) / 255) as Colour);

/**
 * Where isovalues lie between the lowest, 0, and the highest, 1: by value, or by rank where some are so close to others that
 * their colours could not be told apart.
 */
export function places(isovalues: readonly number[]): number[] {
  const rising = [...new Set(isovalues)].sort((a, b) => a - b), low = rising[0] ?? 0, range = rising[rising.length - 1]! - low;
  const least = Math.min(...rising.slice(1).map((x, i) => x - rising[i]!));
  const even = least * (rising.length - 1) >= range / 4;
  return isovalues.map((x) => (rising.length < 2 ? 0 : even ? (x - low) / range : rising.indexOf(x) / (rising.length - 1)));
}

/** The colour of a place: without what is palest on white or darkest on black; of a `solid` without what shows no shades. */
export function colour(place: number, dark: boolean, solid = false): Colour {
  const at = 8 * (solid ? 0.3 + 0.6 * place : dark ? (1 + 5 * place) / 6 : (8 * place) / 9), i = Math.min(7, Math.floor(at)), part = at - i;
  // whole bytes, so that a legend has just the colour of its curve
  return STOPS[i]!.map((x, k) => Math.round(255 * (x + part * (STOPS[i + 1]![k]! - x))) / 255) as Colour;
}
