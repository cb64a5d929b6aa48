// How a probe goes to a place: along a straight line, in steps. One that came into the organ at once would feel nothing.
import type { Vec3 } from "../model/evaluator";

/** A step, in units of the probe's radius. */
const STRIDE = 0.25;

/** The places of its centre on the way, the last of which is the goal [m]. */
export function strides(from: Vec3, to: Vec3, radius: number): Vec3[] {
  const way = to.map((x, i) => x - from[i]!);
  const count = Math.max(1, Math.ceil(Math.hypot(...way) / (STRIDE * radius)));
  return Array.from({ length: count }, (_, k) => from.map((x, i) => x + ((k + 1) / count) * way[i]!) as Vec3);
}
