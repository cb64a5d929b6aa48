// What is told of a touch to the kernel of a notebook.
import type { Vec3 } from "../model/evaluator";

/** Null where nobody touches. */
export interface Told {
  point: Vec3 | null;
  displacement: Vec3 | null;
  force: Vec3 | null;
  is_trusted: boolean | null;
}

export const UNTOUCHED: Told = { point: null, displacement: null, force: null, is_trusted: null };

/** Numbers that differ by less than this part are the same: the page has them in single precision. */
const SAME = 1e-4;

/** Whether two say the same of a touch; lengths are compared beside a depth [m]. */
export function agree(one: Told, other: Told, depth: number): boolean {
  const force = Math.max(size(one.force), size(other.force));
  return (
    one.is_trusted === other.is_trusted &&
    isClose(one.point, other.point, depth) &&
    isClose(one.displacement, other.displacement, depth) &&
    isClose(one.force, other.force, force)
  );
}

function isClose(one: Vec3 | null, other: Vec3 | null, scale: number): boolean {
  if (!one || !other) return one === other;
  return Math.hypot(...one.map((x, i) => x - other[i]!)) <= SAME * scale;
}

function size(vector: Vec3 | null): number {
  return Math.hypot(...(vector ?? [0]));
}
