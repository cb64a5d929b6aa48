// One touch and everything that follows from it: the answer, the field of the chosen order, what every order says.
import type { Standing } from "./arrow";
import { sample, type Curves } from "./curve";
import { fixed, newtons, percent } from "./dom";
import { doubtOf, doubtOfOrder } from "./doubt";
import type { Answer, Evaluator, Felt, Vec3 } from "./evaluator";
import { displacementAt, distance, distances, norm, spreadError, typical } from "./field";
import type { OrderReading } from "./readings";
import { strides } from "./strides";

/** A tool may be moved this much beyond the depth the model is made for; then it slips. */
const BEYOND = 1.3;

/** Directions that differ by no more than this, in each component, have the same curves. */
const SAME = 1e-6;

/** A probe in a hand: what it feels, the normal where the hand took hold, and where its centre was then and went since [m]. */
export interface HeldProbe {
  felt: Felt;
  normal: Vec3;
  outset: Vec3;
  motion: Vec3;
}

/** The numbers of a touch for programs, where nobody touches. */
export const NOBODY = {
  point: null,
  displacement: null,
  force: null,
  stiffness: null,
  error_estimate: null,
  is_trusted: null,
  shape_error_estimate: null,
  is_shape_trusted: null,
  field: null,
  orders: null,
  probe: null,
};

export class TouchState {
  point: Vec3 = [0, 0, 0];
  normal: Vec3 = [0, 0, 1];
  displacement: Vec3 = [0, 0, 0];
  /** How far the hand has moved since it took hold [m]: so much as the contact, but for a probe's. */
  motion: Vec3 = [0, 0, 0];
  /** What a probe in the hand feels; null without one. */
  felt: Felt | null = null;
  /** Where its centre was when the hand took hold [m]. */
  outset: Vec3 = [0, 0, 0];
  answer: Answer;
  force: Vec3 = [0, 0, 0];
  curves: Curves | null = null;
  /** The direction and the factor of the stiffness that the curves are of. */
  private sampled: number[] = [];
  /** The field of the chosen order and that of the highest (s, 3) [m]. */
  readonly field: Float32Array;
  readonly best: Float32Array;
  readonly orders: (OrderReading | null)[];
  private readonly restVolume: number;

  constructor(
    private readonly evaluator: Evaluator,
    point: Vec3,
    normal: Vec3,
    hasProbe = false,
  ) {
    this.field = new Float32Array(evaluator.rest.length);
    this.best = new Float32Array(evaluator.rest.length);
    this.orders = Array.from({ length: evaluator.about.metadata.order }, () => null);
    this.point = evaluator.touch(point) ?? point;
    this.normal = normal;
    evaluator.surface([0, 0, 0], 1, 0);
    this.restVolume = evaluator.volume(0);
    this.answer = evaluator.evaluate([0, 0, 0]);
    if (!hasProbe) return;
    evaluator.lift();
    this.outset = this.point.map((x, i) => x + evaluator.about.metadata.radius * normal[i]!) as Vec3;
    this.felt = evaluator.place(this.outset);
  }

  /** A probe that goes on alone from where it is, as one of two did. */
  static resumed(evaluator: Evaluator, { felt, normal, outset, motion }: HeldProbe, order: number): TouchState {
    const touching = new TouchState(evaluator, felt.point, normal);
    touching.outset = outset;
    touching.felt = evaluator.place(felt.center);
    touching.displace(motion, order);
    return touching;
  }

  get depth(): number {
    return Math.hypot(...this.displacement);
  }

  /** The numbers of the touch, for programs: SI units. */
  get numbers(): Record<keyof typeof NOBODY, unknown> {
    const { point, displacement, force, answer, orders } = this;
    return {
      point,
      displacement,
      force,
      stiffness: answer.stiffness,
      error_estimate: answer.error,
      is_trusted: answer.trust === "trusted",
      shape_error_estimate: answer.shapeError,
      is_shape_trusted: answer.shapeTrust === "trusted",
      field: Array.from(this.field),
      orders,
      probe: this.felt && { center: this.felt.center, gap: this.felt.gap, grip: this.felt.grip },
    };
  }

  /** The touch as one would say it. */
  get inShort(): string {
    return `${newtons(Math.hypot(...this.force))} at a depth of ${fixed(1000 * this.depth, 1)} mm.`;
  }

  /** How far the surface has moved near a point at rest [m]. */
  displacementAt(point: Vec3): Vec3 {
    return displacementAt(this.evaluator.rest, this.field, point);
  }

  /** Whether a point [m] is well within the contact. */
  covers(point: Vec3): boolean {
    const { radius } = this.evaluator.about.metadata;
    return Math.hypot(...point.map((x, i) => x - this.point[i]!)) < 0.6 * radius;
  }

  /** What the chosen order's force is worth. */
  standing(order: number): Standing {
    return this.doubt(order) ? "doubtful" : "sound";
  }

  /** What not to rely on, in a sentence: the chosen order's answer, or the shape alone; empty where all is sound. */
  warning(order: number): string {
    const { shapeTrust, shapeError } = this.answer;
    const doubt = this.doubt(order);
    if (doubt) return `Not trusted: ${doubt}.`;
    if (shapeTrust === "trusted") return "";
    return `The force is trusted, the shape is not: its estimated error is ${percent(shapeError)} here.`;
  }

  /** Whether the chosen order's answer may be relied on, in words; empty where it may. */
  doubt(order: number): string {
    const { metadata } = this.evaluator.about;
    return (
      doubtOf(this.answer, this.felt, this.depth, metadata) ||
      doubtOfOrder(order, metadata.order, this.orders[order - 1]?.off ?? 0)
    );
  }

  /** Moves the hand to a displacement from where it took hold [m]: what every order says, force and field of one of them. */
  displace(d: Vec3, order: number): void {
    const { evaluator } = this;
    const highest = evaluator.about.metadata.order;
    this.answer = this.felt ? this.press(d, this.felt) : this.push(d);
    const size = this.depth;
    if (size > 0) this.turnTo(this.displacement.map((x) => x / size) as Vec3);
    this.best.set(evaluator.surface(this.displacement, highest, 1));
    this.read(highest, this.best);
    for (let p = 1; p < highest; p++) this.read(p, evaluator.surface(this.displacement, p, 1));
    this.choose(order);
  }

  /** The hand holds the contact itself. */
  private push(d: Vec3): Answer {
    const limit = BEYOND * this.evaluator.about.metadata.depth;
    const size = Math.hypot(...d);
    this.displacement = this.motion = size > limit ? (d.map((x) => (x * limit) / size) as Vec3) : d;
    return this.evaluator.evaluate(this.displacement);
  }

  /** The hand holds a probe, which goes along a straight line. */
  private press(d: Vec3, { center: from }: Felt): Felt {
    const goal = this.outset.map((x, i) => x + d[i]!) as Vec3;
    for (const center of strides(from, goal, this.evaluator.about.metadata.radius)) this.felt = this.evaluator.place(center);
    const felt = this.felt!;
    [this.point, this.displacement, this.motion] = [felt.point, felt.displacement, d];
    return felt;
  }

  /** Samples the curves along a direction; who pushes in goes along the same one from move to move. */
  private turnTo(direction: Vec3): void {
    const sampled = [...direction, this.evaluator.factor, ...this.point];
    if (this.curves && sampled.every((x, i) => Math.abs(x - this.sampled[i]!) < SAME)) return;
    this.sampled = sampled;
    this.curves = sample(this.evaluator, direction);
  }

  /** Turns to another order of the same touch. */
  choose(order: number): void {
    const { evaluator } = this;
    const isBest = order === evaluator.about.metadata.order;
    this.field.set(isBest ? this.best : evaluator.surface(this.displacement, order, 1));
    this.force = this.felt && isBest ? this.answer.force : evaluator.force(this.displacement, order);
  }

  /** Fills an order's reading from its field, which is also in slot 1. */
  private read(order: number, field: Float32Array): void {
    const { evaluator, best } = this;
    const size = norm(best);
    this.orders[order - 1] = {
      force: Math.hypot(...evaluator.force(this.displacement, order)),
      volume: evaluator.volume(1) / this.restVolume - 1,
      off: size > 0 ? distance(field, best) / size : 0,
    };
  }

  /** Estimated relative error of the chosen order's field: at a lower one its distance from the highest is added. */
  fieldError(order: number): number {
    const highest = this.evaluator.about.metadata.order;
    return this.answer.shapeError + (order < highest ? (this.orders[order - 1]?.off ?? 0) : 0);
  }

  /** Root mean square of the surface nodes' displacement [m]. */
  get typical(): number {
    return typical(this.field, this.evaluator.outer);
  }

  /** Length of the field's error at every node [m] (s,): from the highest order, or as estimated where that is chosen. */
  localError(order: number, out: Float32Array): void {
    const { evaluator, best } = this;
    const highest = evaluator.about.metadata.order;
    const other = order < highest ? this.field : evaluator.surface(this.displacement, highest - 1, 0);
    if (order < highest) distances(other, best, 1, out);
    else spreadError(best, other, this.answer.shapeError, out);
  }
}

/** What is told of a touch to the kernel of a notebook; null where nobody touches. */
export interface Told {
  point: Vec3 | null;
  displacement: Vec3 | null;
  force: Vec3 | null;
  is_trusted: boolean | null;
}

export function told(touching: TouchState | null): Told {
  if (!touching) return { point: null, displacement: null, force: null, is_trusted: null };
  const { point, displacement, force, answer } = touching;
  return { point, displacement, force, is_trusted: answer.trust === "trusted" };
}
