/** The chunks of a file of an explicit domain (10.1). */
import type { Contents } from "../chunks.js";
import type { Drawing } from "../draw.js";
import type { IsoError } from "../errors.js";
import type { Header, KnownMesh } from "../events.js";
import type { Steps } from "../reader.js";
import { Series } from "../series.js";
import type { Session } from "../session.js";
import { Points } from "./circles.js";
import { CodedMesh } from "./coded.js";
import { Complex, neighboursOf } from "./complex.js";
import { Crossings } from "./crossings.js";
import { Delaunay } from "./delaunay.js";
import { Cells, Cut } from "./cut.js";
import { drawContour, type Unit } from "./drawing.js";
import { Hierarchy } from "./hierarchy.js";
import { Contour } from "./isovalue.js";
import { knownMesh } from "./known.js";
import { Levels } from "./levels.js";
import { LAYERS, Opinions } from "./models.js";
import { Offsets } from "./offsets.js";
import { readPositions, SURFACE } from "./positions.js";
import { Walk } from "./signs.js";
import { Surface } from "./surface.js";
import { Numbers } from "./values.js";

const KINDS = ["known", "coded", "surface", "delaunay"] as const;

export class DomainFile implements Contents {
  readonly series: Series<Contour>;
  /** The mesh, once it is there; or the surface. */
  mesh: Complex | undefined;
  surface: Surface | undefined;
  private inFile = false;
  private begun = false;
  private unit: Unit = { origin: [0, 0, 0], factor: 1, exponent: 0 };
  private hierarchy: Hierarchy | undefined;
  private cells: Cells | undefined;

  constructor(private readonly s: Session, readonly header: Header, private readonly given: KnownMesh | undefined) {
    this.series = new Series<Contour>(s, {
      begin: (isovalue, lean, framed) => new Contour(this.mesh!, isovalue, lean, framed),
      rest: () => undefined,
      finish: (contour) => contour.finish(),
    });
  }

  expect(type: number): void {
    const { r } = this.s;
    if (type === 7) throw r.error("10.1.1", "a mask in a file of an explicit domain");
    if (this.begun === (type === 10)) throw r.error("3.5.8", "a domain has to be the first critical chunk");
    if (this.surface) throw r.error("10.9.1", "a critical chunk behind a surface");
  }

  *arrive(type: number): Steps {
    const { s, s: { r } } = this;
    if (type !== 10) return;
    this.begun = true;
    if (r.at === r.stop) return;
    yield* r.need(1);
    if (r.input.data[r.at]! >> 4 !== 2) return;
    this.surface = new Surface(s);
    if (this.header.n === 2) yield* this.surface.decode();
    else this.surface.held = r.error("3.5.8", "a surface is made of triangles");
  }

  *take(type: number, payload: number, stop: number, bytes: number): Steps {
    const { series, s } = this;
    if (type === 10) {
      if (this.surface?.held) throw this.surface.held;
      const kind = this.surface ? "surface" : yield* this.domain(stop);
      if (this.mesh) series.first(this.header.isovalue);
      s.emit({ type: "domain", bytes, kind });
    } else if (type === 5) yield* series.another(stop, bytes);
    else if (type === 9) yield* series.frame(payload, stop, bytes);
    else if (type === 13) yield* series.series(stop, bytes);
    else if (type === 11) throw s.r.error("3.5.9", "a turn in a file of an explicit domain");
    else yield* this.layer(bytes);
  }

  note(): boolean {
    return false;
  }

  /** The payload of a domain that is not a surface (3.5.8(2), 10.1.2). */
  private *domain(stop: number): Steps<(typeof KINDS)[number]> {
    const { header: { n }, s: { r, coder, meter } } = this, clause = "3.5.8", length = stop - r.at;
    const error = (what = "a domain that is not well formed"): IsoError => r.error(clause, what);
    const head = yield* r.byte(clause), kind = KINDS[head >> 4], d = n + (head & 15);
    const e = yield* r.signed(clause), V = yield* r.varint(clause), T = yield* r.varint(clause);
    if (!kind || d > 3 || Math.abs(e) > 1100 || V <= n || T === 0 || V >= 2 ** 31 || T >= 2 ** 31) throw error();
    if (kind === "known") {
      if (stop - r.at !== 16) throw error();
      this.mesh = knownMesh(this.given, d, n, e, V, T, r.input.data.slice(r.at, stop), meter);
      this.unit = { ...this.unit, exponent: e };
      return kind;
    }
    const factor = yield* r.varint(clause), origin: number[] = [], extent: number[] = [];
    if (kind === "delaunay" && d !== 2) throw error();
    for (let k = 0; k < d; k++) origin.push(yield* r.signed(clause));
    for (let k = 0; k < d; k++) extent.push(yield* r.varint(clause));
    if (factor < 1 || factor > 2 ** 20 || origin.some((x) => Math.abs(x) > 2 ** 40) || V + T > 512 * length ||
      extent.some((x) => x < 1 || x > 2 ** 24)) throw error();
    coder.begin(r.at, stop - r.at);
    const mesh = kind === "coded" ? new CodedMesh(coder, d, n, V, T, extent, (at, what) => r.error(at, what)).decode()
      : yield* this.triangulation(V, T, extent);
    yield* this.s.finish(this.s.coder);
    this.mesh = mesh;
    this.inFile = true;
    this.unit = { origin, factor, exponent: e };
    return kind;
  }

  /** 10.11. */
  private *triangulation(V: number, T: number, extent: readonly number[]): Steps<Complex> {
    const { s, s: { r, coder, meter } } = this, o = new Opinions(coder, SURFACE.make());
    const error = (what: string): IsoError => r.error("10.11", what);
    const found = yield* readPositions(o, extent[0]!, extent[1]!, V, V, () => error("more points than there are vertices"));
    yield* s.finish(s.coder);
    const points = new Points(), all = found.x.map((x, i) => points.add(x, found.y[i]!));
    meter.take(64 * V);
    const hull = points.hull(all);
    if (hull.length < 3) throw error("all points lie on a line");
    const grown = new Delaunay(points, hull, meter), corners = new Set(hull), number: number[] = [];
    for (const p of all) if (!corners.has(p)) grown.insert(p, grown.find(p));
    if (all.length !== V || grown.count !== T) throw error("not the numbers of points and triangles that it states");
    const ranked = [...all].sort((p, q) => points.rank(p, q)), positions = new Float64Array(2 * V);
    ranked.forEach((p, i) => {
      number[p] = i;
      positions[2 * i] = points.x[p]!;
      positions[2 * i + 1] = points.y[p]!;
    });
    const triangles = Array.from({ length: T }, (_, t) => {
      const own = grown.corners.slice(3 * t, 3 * t + 3).map((p) => number[p]!), low = own.indexOf(Math.min(...own));
      return [own[low]!, own[(low + 1) % 3]!, own[(low + 2) % 3]!];
    }).sort((p, q) => p[0]! - q[0]! || p[1]! - q[1]!);
    const cells = Int32Array.from(triangles.flat());
    return new Complex(2, 2, V, T, positions, cells, neighboursOf(2, T, cells, meter), meter);
  }

  /** A layer (10.1.3), whose payload is there. */
  private *layer(bytes: number): Steps {
    const { series, s, s: { r, coder, meter } } = this, clause = "10.1.3", mesh = this.mesh!, contour = series.last;
    const wrong = (what: string): IsoError => r.error(clause, what);
    series.layered = true;
    if (s.planned++ >= 2 ** 17) throw r.error("11.1", "a file has at most 131072 layers");
    const kind = yield* r.byte(clause), numbers: number[] = [];
    if (kind > 4) throw wrong("an unknown kind of layer");
    if (kind === 2) numbers.push(yield* r.byte(clause), yield* r.byte(clause));
    else if (kind % 4) numbers.push(yield* r.varint(clause));
    const first = numbers[0] ?? 0;
    if (kind === 1 && (first < 1 || first > 2 ** 40)) throw wrong("a step out of range");
    if (kind === 2 && Math.max(...numbers) > 52) throw wrong("numbers of more than 52 bits");
    const bare = !contour.whole && !contour.levels;
    if (kind === 0 ? !bare : kind === 1 ? !contour.whole || contour.offsets : kind === 2 ? !contour.whole || contour.values
      : kind === 4 ? !(contour.cut || bare)
      : contour.whole || (contour.levels && first >= contour.levels.left)) throw wrong("a layer that cannot come now");
    contour.begin(meter);
    // of each isovalue that it leans on, numbers and signs are looked at
    meter.step(mesh.V + mesh.T + (mesh.V * contour.depth) / 16);
    meter.take(16 * mesh.V + 4 * mesh.T);
    if (kind === 3 && !contour.levels) contour.levels = this.levels(contour, first, wrong);
    if (kind === 4 && !contour.cut) contour.cut = this.cut(contour);
    coder.begin(r.at, r.stop - r.at);
    const o = new Opinions(coder, contour.models);
    if (kind === 0) {
      contour.leaves = new Walk(contour, mesh).decode(o, (what) => r.error("10.3.1", what));
      contour.parts(() => o.coder.bit(LAYERS.at.FIRST), meter);
    }
    else if (kind === 3) {
      const levels = contour.levels!;
      if (bare) levels.coarse(o);
      else levels.back(o, first);
      if (!levels.left) contour.leaves = new Walk(contour, mesh).find();
    } else if (kind === 4) {
      contour.mesh = contour.cut!.layer(o);
      contour.leaves = new Walk(contour, contour.mesh).find();
      contour.offsets = undefined;
      contour.values = undefined;
    } else {
      const edges = contour.offsets?.edges ?? new Crossings(contour.mesh, contour.leaves!, contour.sign, meter);
      if (kind === 1) (contour.offsets = new Offsets(contour, edges, first)).decode(o);
      else (contour.values = new Numbers(contour, edges, numbers[1]!, first, this.header.scale)).decode(o);
    }
    yield* s.finish(s.coder);
    s.layer(bytes, (["signs", "offsets", "values", "levels", "cut"] as const)[kind]!, series.frames.length - 1,
      series.contours.length - 1, -1);
    yield;
  }

  /** The hierarchy of the mesh, if it is not too large for its unit (10.8.1). */
  private ranked(): Hierarchy {
    const mesh = this.mesh!, { positions, d } = mesh;
    for (let k = 0; k < d; k++) {
      let low = Infinity, high = -Infinity;
      for (let i = k; i < positions.length; i += d) [low, high] = [Math.min(low, positions[i]!), Math.max(high, positions[i]!)];
      if (high - low >= 2 ** 30) throw this.s.r.error("10.8.1", "levels or a cut of a mesh that is too large for its unit");
    }
    return (this.hierarchy ??= new Hierarchy(mesh, this.s.meter));
  }

  /** The first layer of levels of an isovalue, with `left` rounds that are to come back. */
  private levels(contour: Contour, left: number, wrong: (what: string) => IsoError): Levels {
    const hierarchy = this.ranked(), mesh = this.mesh!;
    if (!hierarchy.make(left)) throw wrong("more rounds than there are");
    this.s.meter.take(40 * mesh.V);
    return new Levels(contour, mesh, hierarchy, left);
  }

  /** The first layer of a cut of an isovalue. */
  private cut(contour: Contour): Cut {
    const hierarchy = this.ranked(), mesh = this.mesh!, { meter } = this.s;
    hierarchy.make(Infinity);
    this.cells ??= new Cells(mesh, hierarchy, meter);
    meter.take(40 * mesh.V);
    return new Cut(contour, mesh, hierarchy, this.cells);
  }

  /** The first lines of the text of annex B; none before the domain is there. */
  head(): string[] {
    if (this.surface) return this.surface.lines();
    if (!this.mesh) return [];
    const { d, n, V, T, positions, cells } = this.mesh, lines = [`domain ${d} ${n} ${V} ${T}`];
    if (this.hierarchy) lines.push(`nodes ${this.hierarchy.digest()} ${this.hierarchy.rounds.length}`);
    for (let v = 0; this.inFile && v < V; v++) lines.push(`p ${positions.subarray(d * v, d * v + d).join(" ")}`);
    for (let t = 0; this.inFile && t < T; t++) lines.push(`t ${cells.subarray((n + 1) * t, (n + 1) * (t + 1)).join(" ")}`);
    return lines;
  }

  /** The lines of an isovalue of a frame. */
  lines(frame: number, isovalue: number, lines: string[]): void {
    const { sign, values, offsets } = this.series.frames[frame]![isovalue]!;
    sign.forEach((s, v) => {
      const N = values?.number[v] ?? -1;
      if (s >= 0) lines.push(N < 0 ? `v ${v} ${s}` : `v ${v} ${s} ${N}`);
    });
    if (!offsets) return;
    const { low, high } = offsets.edges, order = low.map((_, e) => e).sort((e, f) => low[e]! - low[f]! || high[e]! - high[f]!);
    for (const e of order) lines.push(`e ${low[e]} ${high[e]} ${offsets.parts[e]} ${offsets.number[e]}`);
  }

  draw(isovalue: number, frame: number): Drawing {
    if (this.surface) return { n: 3, d: 3, full: true, ...this.surface.draw() };
    const contour = this.series.frames[frame]?.[isovalue], { d, n } = this.mesh ?? { d: 2, n: 2 };
    if (!contour) return { n, d, points: new Float64Array(0), cells: new Uint32Array(0), full: false };
    return drawContour(contour, this.mesh!, this.unit, this.header.scale, this.s.meter);
  }
}
