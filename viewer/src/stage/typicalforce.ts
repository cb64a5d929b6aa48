// A typical force, so that arrows are of a readable length.
import type { Body } from "./body";
import type { Evaluator, Vec3 } from "../model/evaluator";

/** Positions that are tried. */
const TRIED = 40;

/** The median force [N] over positions pushed in by half the depth. */
export function typicalForce(evaluator: Evaluator, body: Body): number {
  const { depth, radius } = evaluator.about.metadata;
  const step = Math.max(1, Math.floor(evaluator.positions.length / TRIED));
  const forces: number[] = [];
  for (let p = 0; p < evaluator.positions.length; p += step) {
    const row = 3 * evaluator.positions[p]!;
    const point = evaluator.touch([...evaluator.rest.subarray(row, row + 3)] as Vec3);
    if (!point) continue;
    const push = body.normalAt(point, radius).map((x) => -0.5 * depth * x) as Vec3;
    forces.push(Math.hypot(...evaluator.evaluate(push).force));
  }
  forces.sort((a, b) => a - b);
  return forces[Math.floor(forces.length / 2)] || 1;
}
