/** By how many symbols a context has seen, how far its opinion counts, in 1/256 (7.11(2)). */
export const TRUST = Int32Array.from({ length: 160 }, (_, seen) => Math.floor((512 * seen) / (2 * seen + 3)));
