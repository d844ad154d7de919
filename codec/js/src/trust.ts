/** By how many symbols a context has seen, how far its opinion counts, in 1/256 (7.11(1)). */
export const TRUST = Int32Array.from({ length: 160 }, (_, seen) => Math.floor((512 * seen) / (2 * seen + 3)));

/** Kinds of symbols that have a panel (7.18.3), its lists, and their contexts, which follow on the others. */
export const PANEL_KINDS = 10, PANEL_LISTS = 7, PANEL_CONTEXTS = 13337;
