/** What users of files in tiles see (clause 12). */
import type { Limits } from "../errors.js";
import type { MainProfile } from "../main/profile.js";
import type { Metadata } from "../metadata.js";
import type { Kernels } from "../strand.js";

/** A URL, whose server need not know ranges; a file; or all bytes. */
export type TileSource = string | URL | Blob | Uint8Array;

/** A stage of all tiles (12.3.2). */
export interface Stage {
  /** Samples along an edge of its cubes, of an adaptive one of the smallest. */
  cube: number;
  geometry: boolean;
  adaptive: boolean;
}

/** What a file says of its tiles. */
export interface TilesHead {
  n: number;
  profile: "baseline" | "main";
  /** Samples along each axis of the field. */
  shape: number[];
  /** Steps between samples along each side of a tile, and tiles along each axis. */
  tile: number;
  tiles: number[];
  stages: Stage[];
  /** Isovalues, in the order of the file. */
  isovalues: number[];
  /** How many of them make a group: in a tile those of a group lean on one another, and are decoded together. */
  together: number;
  scale: number | undefined;
  masked: boolean;
  metadata: Metadata;
}

/** From where to where along an axis, in samples. */
export type Box = readonly (readonly [number, number])[];

export interface TilesOptions {
  /** Bounds on what a call may ask for, all tiles together; `bytes` and `memory` bound what it reads of the file. */
  limits?: Partial<Limits>;
  /** The main profile, from `isocodec/main`. */
  main?: MainProfile;
  /** Compiled kernels, from `isocodec/kernels`. */
  kernels?: Kernels | undefined;
  /** Fetches `main.bin`, if `main` is not given; by default from beside this module. */
  loadTables?: () => Promise<Uint8Array>;
  /** Milliseconds that a server's answer, and then each piece of it, may take: 8000 if it is not given. */
  timeout?: number;
  /** Aborts opening the file. */
  signal?: AbortSignal;
}

export interface WindowOptions {
  /** Number of the isovalue, 0 if it is not given; of `window` alone. */
  isovalue?: number;
  /** Cubes of the mesh no wider than so many samples will do. */
  within?: number;
  /** The number of a stage, from 0; without it and `within` the last one. */
  layer?: number;
  /** Aborts requests, and the work between two tiles. */
  signal?: AbortSignal;
}
