// Fields at the surface nodes (s, 3) [m]: how large they are, and what they are at a point.
import type { Vec3 } from "./evaluator";

/** Root of the sum of squares of all components. */
export function norm(field: Float32Array): number {
  return Math.sqrt(field.reduce((sum, x) => sum + x * x, 0));
}

/** The same of the difference of two fields. */
export function distance(one: Float32Array, other: Float32Array): number {
  let sum = 0;
  for (let i = 0; i < one.length; i++) sum += (one[i]! - other[i]!) ** 2;
  return Math.sqrt(sum);
}

/** Distance of a vector from another one, relative to that; 0 where that is zero. */
export function apart(one: Vec3, other: Vec3): number {
  const size = Math.hypot(...other);
  return size > 0 ? Math.hypot(...one.map((x, i) => x - other[i]!)) / size : 0;
}

/** Lengths (s,) of the vectors. */
export function lengths(field: Float32Array, out: Float32Array): void {
  for (let n = 0; n < out.length; n++) {
    const [x, y, z] = [field[3 * n]!, field[3 * n + 1]!, field[3 * n + 2]!];
    out[n] = Math.sqrt(x * x + y * y + z * z);
  }
}

/** Lengths (s,) of the differences of two fields, times a factor. */
export function distances(one: Float32Array, other: Float32Array, factor: number, out: Float32Array): void {
  for (let n = 0; n < out.length; n++) {
    const at = 3 * n;
    out[n] = factor * Math.hypot(one[at]! - other[at]!, one[at + 1]! - other[at + 1]!, one[at + 2]! - other[at + 2]!);
  }
}

/**
 * Lengths (s,) of the error of a field, of which the whole is estimated, relative to the norm: over the surface it is
 * spread like the difference from another field, that of one order less.
 */
export function spreadError(field: Float32Array, other: Float32Array, error: number, out: Float32Array): void {
  const last = distance(other, field);
  distances(other, field, last > 0 ? (error * norm(field)) / last : 0, out);
}

/** Root mean square of the displacement of some nodes [m]. */
export function typical(field: Float32Array, nodes: Uint32Array): number {
  const sum = nodes.reduce((sum, n) => sum + field[3 * n]! ** 2 + field[3 * n + 1]! ** 2 + field[3 * n + 2]! ** 2, 0);
  return Math.sqrt(sum / nodes.length);
}

/** What a field (s, 3) is at the node closest to a point at rest, among those that count. */
export function displacementAt(
  rest: Float32Array,
  field: Float32Array,
  point: Vec3,
  counts: (node: number) => boolean = () => true,
): Vec3 {
  let [best, least] = [0, Infinity];
  for (let n = 0; n < rest.length; n += 3) {
    const distance = Math.hypot(rest[n]! - point[0], rest[n + 1]! - point[1], rest[n + 2]! - point[2]);
    if (distance < least && counts(n / 3)) [best, least] = [n, distance];
  }
  return [...field.subarray(best, best + 3)] as Vec3;
}
