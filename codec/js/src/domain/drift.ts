/** How far numbers go from frame to frame, and second guesses by it (10.6.3). */

export class Drift {
  private drift = 0;
  private wide = 0;

  /** The second guess with its width; `width` is that of the first one. */
  guess(place: number, above: boolean, width: number): readonly [number, number] {
    return [above ? place + this.drift : place - this.drift, this.wide || width];
  }

  /** A number has come that is `by` behind its place of then. */
  see(by: number, above: boolean): void {
    const step = above ? by : -by, wrong = Math.abs(step - this.drift);
    if (!this.wide) this.wide = wrong;
    this.drift += Math.floor((step - this.drift) / 8);
    this.wide = Math.max(this.wide + Math.floor((wrong - this.wide) / 16), 64);
  }
}
