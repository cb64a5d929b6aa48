// How much the surface is stretched: of every triangle the largest change of length in its plane, at nodes as means.
//
// With the edges e_k of a triangle without load and moved, C = F^T F in its plane has the eigenvalues lambda^2, and the strain
// is the larger of |lambda_1 - 1| and |lambda_2 - 1|.

export class SurfaceStrain {
  /** Of each triangle without load: the inverse of its edges (2, 2) in an orthonormal basis of its plane, and its area. */
  private readonly inverse: Float64Array;
  private readonly area: Float64Array;
  private readonly around: Float64Array;

  /** rest (s, 3) [m], and the same without the load that it may be under; triangles between their rows. */
  constructor(
    private readonly rest: Float32Array,
    private readonly triangles: Uint32Array,
    unloaded = rest,
  ) {
    const count = triangles.length / 3;
    this.inverse = new Float64Array(3 * count);
    this.area = new Float64Array(count);
    this.around = new Float64Array(rest.length / 3);
    for (let t = 0; t < count; t++) {
      const [aa, ab, bb] = products(unloaded, null, triangles, t);
      // Edges (length, 0) and (along, height) in the plane.
      const length = Math.sqrt(aa);
      const along = ab / length;
      const height = Math.sqrt(Math.max(bb - along * along, 0));
      this.inverse.set([1 / length, -along / (length * height), 1 / height], 3 * t);
      this.area[t] = 0.5 * length * height;
      for (let k = 0; k < 3; k++) this.around[triangles[3 * t + k]!]! += this.area[t]!;
    }
  }

  /** The strain at every node (s,) under a field (s, 3) [m], or under none; 0 where no triangle is. */
  at(field: Float32Array | null, out: Float32Array): void {
    const { rest, triangles, inverse, area, around } = this;
    out.fill(0);
    for (let t = 0; t < area.length; t++) {
      const [aa, ab, bb] = products(rest, field, triangles, t);
      const [p, q, r] = [inverse[3 * t]!, inverse[3 * t + 1]!, inverse[3 * t + 2]!];
      const xx = p * p * aa;
      const xy = p * (q * aa + r * ab);
      const yy = q * q * aa + 2 * q * r * ab + r * r * bb;
      const [mean, apart] = [0.5 * (xx + yy), Math.hypot(0.5 * (xx - yy), xy)];
      const strain = Math.max(Math.sqrt(mean + apart) - 1, 1 - Math.sqrt(Math.max(mean - apart, 0)));
      for (let k = 0; k < 3; k++) out[triangles[3 * t + k]!]! += area[t]! * strain;
    }
    for (let n = 0; n < out.length; n++) if (around[n]! > 0) out[n]! /= around[n]!;
  }
}

/** Of the two edges from a triangle's first corner: a.a, a.b, b.b [m^2]. */
function products(rest: Float32Array, field: Float32Array | null, triangles: Uint32Array, t: number): [number, number, number] {
  let [aa, ab, bb] = [0, 0, 0];
  const [o, m, n] = [3 * triangles[3 * t]!, 3 * triangles[3 * t + 1]!, 3 * triangles[3 * t + 2]!];
  for (let i = 0; i < 3; i++) {
    const origin = rest[o + i]! + (field ? field[o + i]! : 0);
    const a = rest[m + i]! + (field ? field[m + i]! : 0) - origin;
    const b = rest[n + i]! + (field ? field[n + i]! : 0) - origin;
    aa += a * a;
    ab += a * b;
    bb += b * b;
  }
  return [aa, ab, bb];
}
