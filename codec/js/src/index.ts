/** Decoder of .iso files. */
export * from "./decoder.js";
export { draw, type Drawing } from "./draw.js";
export type { Coordinate, Coordinates } from "./coordinates.js";
export { IsoError, type ErrorKind, type Limits, LIMITS } from "./errors.js";
export { placement, type Metadata, type Promises } from "./metadata.js";
export { decodeStream, fetchTables, type StreamOptions, supply } from "./stream.js";
export { canonicalText, coordinatesText } from "./text.js";
export { lines, place, toGeoJSON, type LineFeature, type Where } from "./world.js";
