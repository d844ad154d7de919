/** Things that are kept by a key, the oldest of them forgotten when they are too large together. */
export class Kept<K, V> {
  private readonly all = new Map<K, { value: V; size: number }>();
  private total = 0;

  constructor(private readonly most: number) {}

  get(key: K): V | undefined {
    return this.all.get(key)?.value;
  }

  set(key: K, value: V, size: number): void {
    this.total += size - (this.all.get(key)?.size ?? 0);
    this.all.delete(key);
    this.all.set(key, { value, size });
    for (const [old, each] of this.all) {
      if (this.total <= this.most) break;
      this.all.delete(old);
      this.total -= each.size;
    }
  }
}
