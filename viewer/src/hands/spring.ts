// How a contact comes back when the hand lets go: quickly, and without a jump at the end.
import type { Vec3 } from "../model/evaluator";

const SECONDS = 0.22;

export class Spring {
  private at = 0;
  private from: Vec3 = [0, 0, 0];

  /** Lets go of a displacement [m]. */
  release(from: Vec3): void {
    [this.at, this.from] = [0, from];
  }

  /** The displacement [m] after some more seconds; null once it is at rest. */
  advance(seconds: number): Vec3 | null {
    this.at += seconds;
    const left = 1 - this.at / SECONDS;
    if (left <= 0 || matchMedia("(prefers-reduced-motion: reduce)").matches) return null;
    return this.from.map((x) => x * left * left) as Vec3;
  }
}
