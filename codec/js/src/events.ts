/** What a decoder reports and what it is asked (8.2.2). */
import type { IsoError, Limits } from "./errors.js";
import type { MainProfile } from "./main/profile.js";
import type { Metadata, Promises } from "./metadata.js";
import type { Layer } from "./program.js";
import type { Kernels } from "./strand.js";

export interface Header {
  /** Axes of a grid, or the dimension of the cells of an explicit domain (clause 10). */
  n: number;
  /** Samples along each axis; nothing for an explicit domain. */
  shape: number[];
  explicit: boolean;
  profile: "baseline" | "main";
  isovalue: number;
  /** The scale of scaled data, undefined for integer data. */
  scale: number | undefined;
}

/** What an isovalue of a further frame leans on: that of the frame before, an earlier one of its own frame, or none. */
export type FrameLean = "before" | number | undefined;

/** Layers of explicit domains (10.1.3) beside those of grids. */
export type LayerKind = Layer["kind"] | "signs" | "levels" | "cut";

/** What has happened, with the number of bytes of the file that it needed. */
export type IsoEvent =
  | { type: "header"; bytes: number; header: Header }
  | { type: "layer"; bytes: number; kind: LayerKind; number: number; frame: number; isovalue: number; level: number }
  | { type: "isovalue"; bytes: number; index: number; isovalue: number; lean: number | undefined }
  | { type: "turn"; bytes: number; first: number; count: number }
  | { type: "series"; bytes: number; interval: number }
  | { type: "frame"; bytes: number; frame: number; index: number; isovalue: number; lean: FrameLean }
  | { type: "domain"; bytes: number; kind: "known" | "coded" | "delaunay" | "surface" }
  | { type: "metadata"; bytes: number; metadata: Metadata }
  | { type: "promises"; bytes: number; isovalue: number; promises: Promises }
  | { type: "coordinates"; bytes: number }
  | { type: "mask"; bytes: number }
  | { type: "skipped"; bytes: number; chunk: number }
  | { type: "end"; bytes: number }
  | { type: "error"; bytes: number; error: IsoError };

/** A mesh that both sides have (10.1.2(1)): coordinates of the vertices, and the vertices of each cell, in order. */
export interface KnownMesh {
  /** Coordinates of a vertex, 2 or 3. */
  d: number;
  /** Dimension of the cells: each has `n + 1` vertices. */
  n: number;
  coordinates: ArrayLike<number>;
  cells: ArrayLike<number>;
}

export interface DecoderOptions {
  limits?: Partial<Limits>;
  /** The main profile, from `isocodec/main`; without it files of that profile wait for `setMain`. */
  main?: MainProfile;
  /** What reads explicit domains, from `isocodec/domain`; without it files of these wait for `setDomains`. */
  domains?: Domains;
  /** Compiled kernels, from `isocodec/kernels`, with which files of grids are decoded several times as fast. */
  kernels?: Kernels | undefined;
  /** The mesh of a file that only says which one it is. */
  mesh?: KnownMesh | undefined;
  /** Whether the state of all frames of a series is kept; otherwise that of the last two is. */
  keepFrames?: boolean;
}

/** The module of explicit domains, which is loaded when a file needs it. */
export type Domains = typeof import("./domain/contents.js");
