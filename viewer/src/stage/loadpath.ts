// A load path: the contact wanders over the surface from one end to the other while it is pushed in.
import type { Body } from "./body";
import type { Evaluator, Vec3 } from "../model/evaluator";

const STATIONS = 240;
const SECONDS = 9;
/** How much of the depth, at the most, the path pushes in. */
const SHARE = 0.6;

/** One station: a contact, its outward normal, and its displacement. */
export interface Station {
  point: Vec3;
  normal: Vec3;
  displacement: Vec3;
}

export class LoadPath {
  readonly stations: Station[];
  /** How much of the way has been gone at the most. */
  gone = 0;
  /** Seconds since the start; the path comes back and begins again. */
  private time = 0;

  constructor(evaluator: Evaluator, body: Body) {
    const { depth, radius } = evaluator.about.metadata;
    this.stations = curve(evaluator).map((point, k) => {
      const normal = body.normalAt(point, radius);
      const push = -SHARE * depth * Math.sin(Math.PI * Math.min(1, (4 * Math.min(k, STATIONS - k)) / STATIONS) * 0.5);
      return { point, normal, displacement: normal.map((x) => push * x) as Vec3 };
    });
  }

  restart(): void {
    this.time = this.gone = 0;
  }

  /** The station after some more seconds. */
  advance(seconds: number): Station {
    this.time = (this.time + seconds) % (2 * SECONDS);
    const there = this.time / SECONDS;
    const share = there <= 1 ? there : 2 - there;
    this.gone = Math.max(this.gone, share);
    return this.at(share);
  }

  /** The station at a share of the way. */
  at(share: number): Station {
    return this.stations[Math.round(share * (this.stations.length - 1))]!;
  }
}

/** Touchable points along the longest axis of the load positions, swinging from side to side. */
function curve(evaluator: Evaluator): Vec3[] {
  const points = Array.from(evaluator.positions, (row) => [...evaluator.rest.subarray(3 * row, 3 * row + 3)] as Vec3);
  const middle = [0, 1, 2].map((i) => points.reduce((sum, x) => sum + x[i]!, 0) / points.length) as Vec3;
  const [along, across] = principalAxes(points, middle);
  const of = (x: Vec3, axis: Vec3) => axis.reduce((sum, a, i) => sum + a * (x[i]! - middle[i]!), 0);
  const [low, high] = reach(points.map((x) => of(x, along)));
  const [left, right] = reach(points.map((x) => of(x, across)));
  const found: Vec3[] = [];
  for (let k = 0; k <= STATIONS; k++) {
    const share = k / STATIONS;
    const s = low + (0.08 + 0.84 * share) * (high - low);
    const swing = 0.5 * (left + right) + 0.18 * (right - left) * Math.sin(2 * Math.PI * share);
    // The load positions near that line, blended smoothly: the closest point of the surface follows.
    const width = 0.06 * (high - low);
    const sum: Vec3 = [0, 0, 0];
    let total = 0;
    for (const x of points) {
      const share = Math.exp(-0.5 * (((of(x, along) - s) ** 2 + (of(x, across) - swing) ** 2) / width ** 2));
      total += share;
      for (let i = 0; i < 3; i++) sum[i]! += share * x[i]!;
    }
    const contact = total > 0 ? evaluator.touch(sum.map((x) => x / total) as Vec3) : null;
    if (contact) found.push(contact);
  }
  return found;
}

/** Directions of the largest and the second spread, by power iteration. */
function principalAxes(points: Vec3[], middle: Vec3): [Vec3, Vec3] {
  const spread = [0, 1, 2].map((i) =>
    [0, 1, 2].map((j) => points.reduce((sum, x) => sum + (x[i]! - middle[i]!) * (x[j]! - middle[j]!), 0)),
  );
  const first = strongest(spread, null);
  return [first, strongest(spread, first)];
}

function strongest(matrix: number[][], without: Vec3 | null): Vec3 {
  let v: Vec3 = [0.7, 0.5, 0.3];
  for (let k = 0; k < 100; k++) {
    if (without) {
      const part = v.reduce((sum, x, i) => sum + x * without[i]!, 0);
      v = v.map((x, i) => x - part * without[i]!) as Vec3;
    }
    const next = matrix.map((row) => row.reduce((sum, a, j) => sum + a * v[j]!, 0));
    const size = Math.hypot(...next) || 1;
    v = next.map((x) => x / size) as Vec3;
  }
  return v;
}

function reach(values: number[]): [number, number] {
  return [Math.min(...values), Math.max(...values)];
}
