// The derivative of a polynomial force, from its values: those of the orders below the highest are polynomials.
import type { Vec3 } from "./evaluator";

/**
 * Stiffness dF/dd (9) [N/m], row by row, of a force that is a polynomial of a degree in the displacement d [m]:
 * `dF/dd_j = sum_k c_k (F(d + k h e_j) - F(d - k h e_j)) / h` with `c_k = (-1)^(k+1) n!^2 / (k (n - k)! (n + k)!)`, k = 1..n,
 * which is exact up to the degree 2 n. `h` [m] is a length over which the force changes.
 */
export function stiffnessOf(force: (d: Vec3) => Vec3, d: Vec3, degree: number, h: number): number[] {
  const n = Math.ceil(degree / 2);
  const rows = new Array<number>(9).fill(0);
  let weight = 1;
  for (let k = 1; k <= n; k++) {
    // From one k to the next: n! n! / ((n - k)! (n + k)!), with its sign.
    weight *= (k === 1 ? 1 : -1) * ((n - k + 1) / (n + k));
    for (const j of [0, 1, 2]) {
      const [ahead, behind] = [k, -k].map((steps) => force(d.map((x, i) => (i === j ? x + steps * h : x)) as Vec3));
      for (const i of [0, 1, 2]) rows[3 * i + j]! += (weight * (ahead![i]! - behind![i]!)) / (k * h);
    }
  }
  return rows;
}
