/** Files in tiles (clause 12): windows of their curves, read as they are asked for. */
import { Decoder } from "../decoder.js";
import { draw, type Drawing } from "../draw.js";
import { LIMITS, type Limits } from "../errors.js";
import type { MainProfile } from "../main/profile.js";
import { fetchTables } from "../stream.js";
import { Directory } from "./directory.js";
import { join, type Piece } from "./join.js";
import { Kept } from "./kept.js";
import { Pieces } from "./source.js";
import type { Box, TilesHead, TileSource, TilesOptions, WindowOptions } from "./types.js";

export type { Directory } from "./directory.js";
export type * from "./types.js";

/** Points of tiles' drawings that are kept for the next window. */
const KEPT_POINTS = 2 ** 21;
/** Milliseconds after which others have a turn. */
const TURN = 40;
/** Milliseconds that a server may take. */
const PATIENCE = 8000;

/** Open a file in tiles: reads its head. */
export async function openTiles(source: TileSource, options: TilesOptions = {}): Promise<TiledFile> {
  const limits = { ...LIMITS, ...options.limits }, most = Math.min(limits.bytes, limits.memory);
  return new TiledFile(await Directory.open(new Pieces(source, most, options.timeout ?? PATIENCE), options.signal), limits, options);
}

export class TiledFile {
  readonly head: TilesHead;
  private readonly drawings = new Kept<string, Drawing>(KEPT_POINTS);
  private rested = 0;
  private main: Promise<MainProfile> | undefined;

  constructor(readonly directory: Directory, private readonly limits: Limits, private readonly options: TilesOptions) {
    this.head = directory.head;
  }

  /** Pieces of the file that have been read. */
  get requests(): number {
    return this.directory.pieces.requests;
  }

  /** Bytes of these. */
  get received(): number {
    return this.directory.pieces.received;
  }

  /** The curve or surface in a box of samples: all cells that lie in it, in whole or in part. */
  async window(box: Box | undefined, options: WindowOptions = {}): Promise<Drawing> {
    return (await this.windows(box, [options.isovalue ?? 0], options))[0]!;
  }

  /** The curves or surfaces of several isovalues, by number, in a box of samples; all that they need is read together. */
  async windows(box: Box | undefined, isovalues: readonly number[], options: WindowOptions = {}): Promise<Drawing[]> {
    const { directory, head } = this, { signal } = options, stage = this.stage(options);
    const unknown = isovalues.find((isovalue) => !(isovalue in head.isovalues));
    if (unknown !== undefined) throw new RangeError(`there is no isovalue ${unknown}; the file has ${head.isovalues.length}`);
    if (box && (box.length !== head.n || !box.every(([from, to]) => from <= to)))
      throw new RangeError(`a box is ${head.n} pairs, from where to where along each axis`);
    const blocks = await directory.blocks(box, signal), limits = { ...this.limits };
    const wanted = isovalues.map((isovalue) => {
      const places = blocks.flatMap(([block, channels]) => directory.coded(block, channels, [isovalue], box))
        .filter((place) => directory.filled(place, isovalue, stage));
      return places.map((place) => {
        const key = `${place.index} ${isovalue} ${stage}`, group = `${place.index} ${directory.group(isovalue)[0]!}`;
        return { place, isovalue, key, group, drawing: this.drawings.get(key) };
      });
    });
    signal?.throwIfAborted();
    const fresh = wanted.flat().filter(({ drawing }) => !drawing);
    const groups = await directory.fetch(fresh.flatMap(({ place, isovalue }) => directory.segments(place, isovalue, stage)), signal);
    // what a tile has at a group's isovalues is decoded once
    const together = new Map<string, typeof fresh>();
    for (const tile of fresh) together.set(tile.group, [...(together.get(tile.group) ?? []), tile]);
    const joined: Drawing[] = [];
    for (const tiles of wanted) {
      for (const tile of tiles) {
        if (tile.drawing) continue;
        await this.turn(signal);
        const file = directory.file(tile.place, tile.isovalue, stage, groups), decoder = await this.decode(file, limits);
        for (const each of together.get(tile.group)!) {
          each.drawing = draw(decoder, directory.at(each.place, each.isovalue).indexOf(each.isovalue), 0, true);
          this.drawings.set(each.key, each.drawing, each.drawing.points.length);
        }
        // what a tile takes, of work beyond what its bytes allow, is missing to the others
        limits.work -= Math.max(0, decoder.meter.steps / 16 - limits.workPerByte * file.length);
        limits.vertices -= decoder.meter.vertices;
      }
      const pieces = tiles.map(({ place, drawing }): Piece => ({
        origin: place.index.map((i) => i * head.tile), last: directory.widths(place.index).map((w) => w - 1), drawing: drawing!,
      }));
      const drawing = join(head.n, head.shape.map((s) => s - 1), pieces, box, limits.memory);
      limits.memory -= drawing.points.byteLength + drawing.cells.byteLength;
      joined.push(drawing);
    }
    return joined;
  }

  /** The whole curve or surface. */
  all(options: WindowOptions = {}): Promise<Drawing> {
    return this.window(undefined, options);
  }

  /** The number of the stage that options ask for. */
  stage({ within, layer }: Pick<WindowOptions, "within" | "layer">): number {
    const { stages } = this.head, last = stages.length - 1;
    if (within !== undefined && layer !== undefined) throw new RangeError("within and layer contradict one another");
    if (layer !== undefined && !(layer in stages)) throw new RangeError(`there is no layer ${layer}; the file has ${last + 1}, from 0 on`);
    const found = within === undefined ? (layer ?? last) : stages.findIndex(({ cube }) => cube <= within);
    return found < 0 ? last : found;
  }

  /** Decode the file of a tile. */
  async decode(file: Uint8Array, limits: Limits = this.limits): Promise<Decoder> {
    const main = this.head.profile === "main" ? await (this.main ??= this.load()) : undefined;
    const decoder = new Decoder({ limits, kernels: this.options.kernels, ...(main && { main }) });
    decoder.feed(file);
    decoder.end();
    if (decoder.error) throw decoder.error;
    return decoder;
  }

  private async load(): Promise<MainProfile> {
    const { main, loadTables = fetchTables } = this.options;
    if (main) return main;
    const [{ MainProfile }, bytes] = await Promise.all([import("../main/profile.js"), loadTables()]);
    return new MainProfile(bytes);
  }

  /** From time to time others have a turn; one of them may abort this. */
  private async turn(signal: AbortSignal | undefined): Promise<void> {
    if (performance.now() - this.rested > TURN) {
      await new Promise((resolve) => setTimeout(resolve, 0));
      this.rested = performance.now();
    }
    signal?.throwIfAborted();
  }
}
