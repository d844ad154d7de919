export * from "./decoder.js";
export { IsoError, type ErrorKind, type Limits, LIMITS } from "./errors.js";
export { canonicalText } from "./text.js";
