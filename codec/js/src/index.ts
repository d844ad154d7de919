/** Decoder of .iso files. What not every program needs are modules of their own: draw, world, text, main, domain. */
export * from "./decoder.js";
export { IsoError, type ErrorKind, type Limits, LIMITS } from "./errors.js";
export type { Metadata, Promises } from "./metadata.js";
export { decodeStream, fetchTables, type StreamOptions, supply } from "./stream.js";
