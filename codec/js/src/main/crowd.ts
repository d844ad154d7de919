/** Counts of vertices and of new components in cells of all sizes (7.13(1)). */
import { Cells } from "../store.js";
import type { Tube } from "../tube.js";

export class Crowd {
  vertices = 0;
  births = 0;
  private readonly cells: Cells[] = [];
  private readonly counts: Uint16Array[] = [];
  private counted = 0;

  constructor(private readonly t: Tube) {
    const [lastX, lastY, lastZ] = t.grid.last;
    for (let j = 0; j <= t.grid.k; j++) {
      this.cells.push(new Cells(t.meter, (lastX >> j) + 1, (lastY >> j) + 1, (lastZ >> j) + 1, 1 << 16));
      this.counts.push(new Uint16Array(32));
    }
  }

  private add(j: number, x: number, y: number, z: number, which: number): void {
    const id = 2 * this.cells[j]!.add(x >> j, y >> j, z >> j) + which;
    let counts = this.counts[j]!;
    if (id >= counts.length) {
      this.t.meter.take(2 * counts.length);
      counts = new Uint16Array(2 * counts.length);
      counts.set(this.counts[j]!);
      this.counts[j] = counts;
    }
    if (counts[id]! < 1024) counts[id]!++;
  }

  /** Count the vertices that have become known since the last time. */
  count(): void {
    const { data, length } = this.t.known;
    for (let i = this.counted; i < length; i += 3) {
      for (let j = 0; j <= this.t.grid.k; j++) this.add(j, data[i]!, data[i + 1]!, data[i + 2]!, 0);
    }
    this.counted = length;
  }

  /** Count a new component, at a position. */
  born(x: number, y: number, z: number): void {
    for (let j = 0; j <= this.t.grid.k; j++) this.add(j, x, y, z, 1);
  }

  look(j: number, x: number, y: number, z: number): void {
    const id = 2 * this.cells[j]!.find(x, y, z), counts = this.counts[j]!;
    this.vertices = counts[id]!;
    this.births = counts[id + 1]!;
  }
}
