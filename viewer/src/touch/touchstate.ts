// One touch and everything that follows from it: the answer, the field of the chosen order, what every order says.
import type { Standing } from "../stage/arrow";
import { sample, type Curves } from "../panels/curve";
import { depthInWords, digits, newtons, percent } from "../base/dom";
import { doubtOf, doubtOfOrder, roomBeside, type Distances } from "../panels/doubt";
import type { Answer, Evaluator, Felt, Vec3 } from "../model/evaluator";
import { apart, displacementAt, distance, distances, norm, spreadError, typical } from "../model/field";
import type { OrderReading, TouchReading } from "../panels/readings";
import { stiffnessOf } from "../model/slope";
import { strides } from "./strides";
import type { Told } from "./told";

/** A tool may be moved this much beyond the depth the model is made for; then it slips. */
export const BEYOND = 1.3;

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
  /** How far the contact was to be displaced where it slipped before [m]; 0 where it did not. */
  private slipped = 0;
  /** How far the hand has moved since it took hold [m]: so much as the contact, but for a probe's. */
  motion: Vec3 = [0, 0, 0];
  /** What a probe in the hand feels; null without one. */
  felt: Felt | null = null;
  /** Where its centre was when the hand took hold [m]. */
  outset: Vec3 = [0, 0, 0];
  answer: Answer;
  /** Of the chosen order, as is its derivative (9) [N/m]. */
  force: Vec3 = [0, 0, 0];
  stiffness: number[] = [];
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

  get hasProbe(): boolean {
    return this.felt !== null;
  }

  /** The numbers of the touch in the chosen order, for programs: SI units. */
  numbers(order: number): Record<keyof typeof NOBODY, unknown> {
    const { point, displacement, force, orders } = this;
    return {
      point,
      displacement,
      force,
      stiffness: this.stiffness,
      error_estimate: this.forceError(order),
      is_trusted: !this.doubt(order),
      shape_error_estimate: this.fieldError(order),
      is_shape_trusted: this.isShapeTrusted(order),
      field: Array.from(this.field),
      orders,
      probe: this.felt && { center: this.felt.center, gap: this.felt.gap, grip: this.felt.grip },
    };
  }

  /** What is read off in the chosen order. */
  reading(order: number): TouchReading {
    const [force, isDoubtful] = [Math.hypot(...this.force), this.doubt(order) !== ""];
    const [error, shapeError] = [this.forceError(order), this.fieldError(order)];
    return { force, depth: this.depth, stiffness: this.stiffness, error, shapeError, isDoubtful };
  }

  /** The touch as one would say it, and what it is worth if that is to be said, too. */
  inShort(order: number, worth = ""): string {
    const size = `${newtons(Math.hypot(...this.force))} at a depth of ${depthInWords(this.depth)}`;
    return `${[size, ...conditions(this.evaluator, order), worth].filter(Boolean).join(", ")}.`;
  }

  /** What is not to be relied on, in two words; empty where all is sound. */
  worth(order: number): string {
    if (this.doubt(order)) return "not trusted";
    return this.isShapeTrusted(order) ? "" : "shape not trusted";
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
    const doubt = this.doubt(order);
    if (doubt) return `Not trusted: ${doubt}.`;
    if (this.isShapeTrusted(order)) return "";
    return `The force is trusted, the shape is not: its estimated error is ${percent(this.fieldError(order))} here.`;
  }

  /** Whether the chosen order's answer may be relied on, in words; empty where it may. */
  doubt(order: number): string {
    const { answer, evaluator } = this;
    const { metadata } = evaluator.about;
    const doubt = doubtOf(answer, this.felt, this.depth, metadata, this.slipped);
    return doubt || doubtOfOrder(order, metadata.order, this.distancesOf(order), this.room(answer.error));
  }

  /** Whether the chosen order's shape is within the allowance. */
  isShapeTrusted(order: number): boolean {
    const { shapeTrust, shapeError } = this.answer;
    return shapeTrust === "trusted" && this.distancesOf(order).off <= this.room(shapeError);
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
    // A hand that follows this limit itself may pass it by rounding.
    this.slipped = size > (1 + SAME) * limit ? size : 0;
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
    this.curves = sample(this.evaluator, direction, BEYOND);
  }

  /** Turns to another order of the same touch. */
  choose(order: number): void {
    const { evaluator } = this;
    const isBest = order === evaluator.about.metadata.order;
    this.field.set(isBest ? this.best : evaluator.surface(this.displacement, order, 1));
    this.force = this.felt && isBest ? this.answer.force : evaluator.force(this.displacement, order);
    const step = 0.1 * evaluator.about.metadata.depth;
    this.stiffness = isBest ? this.answer.stiffness : stiffnessOf((d) => evaluator.force(d, order), this.displacement, order, step);
  }

  /** Fills an order's reading from its field, which is also in slot 1. */
  private read(order: number, field: Float32Array): void {
    const { evaluator, best } = this;
    const size = norm(best);
    const force = evaluator.force(this.displacement, order);
    this.orders[order - 1] = {
      force: Math.hypot(...force),
      volume: evaluator.volume(1) / this.restVolume - 1,
      off: size > 0 ? distance(field, best) / size : 0,
      forceOff: apart(force, this.answer.force),
    };
  }

  /** How far a lower order's answer is from the highest one's. */
  private distancesOf(order: number): Distances {
    const isLower = order < this.evaluator.about.metadata.order;
    return (isLower && this.orders[order - 1]) || { off: 0, forceOff: 0 };
  }

  /** How far it may be, beside an estimated error of that. */
  private room(error: number): number {
    return roomBeside(error, this.depth, this.evaluator.about.metadata, this.hasProbe);
  }

  /** Estimated relative error of the chosen order's force: at a lower one its distance from the highest is added. */
  forceError(order: number): number {
    return this.answer.error + this.distancesOf(order).forceOff;
  }

  /** The same of its field. */
  fieldError(order: number): number {
    return this.answer.shapeError + this.distancesOf(order).off;
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

/** A touch in the field of an order: the force, and what it is worth, are those of the order. */
export function told(touching: TouchState, order: number): Told {
  const { point, displacement, force } = touching;
  return { point, displacement, force, is_trusted: !touching.doubt(order) };
}

/** What a force is said to be of, where it is not that of the highest order and of the organ's own stiffness. */
export function conditions({ about, factor }: Evaluator, order: number): string[] {
  const isLower = order < about.metadata.order;
  return [...(isLower ? [`order ${order}`] : []), ...(factor === 1 ? [] : [`stiffness × ${digits(factor, 2)}`])];
}
