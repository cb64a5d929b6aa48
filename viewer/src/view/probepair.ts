// Two probes on a reduced model, one in each hand, which feel each other through the organ (docs/probe.md).
import type { Standing } from "../stage/arrow";
import type { Hit } from "../stage/body";
import type { Coloured } from "./colouring";
import type { Display } from "./display";
import { depthInWords, element, fact, newtons, percent, write } from "../base/dom";
import { doubtOf, doubtOfOrder, roomBeside } from "../panels/doubt";
import type { Evaluator, Vec3 } from "../model/evaluator";
import { apart, distance, distances, norm, spreadError, typical } from "../model/field";
import { Grip } from "../hands/grip";
import type { Shift } from "../stage/inside";
import type { Reading } from "../hands/pointer";
import type { Stage } from "../stage/stage";
import { strides } from "../touch/strides";
import type { Told } from "../touch/told";
import { conditions, TouchState, type HeldProbe } from "../touch/touchstate";

const NAMES = ["first probe", "second probe"] as const;
const WORDS = "Each probe feels the other through the organ. The shape is the sum of both touches; the estimate includes the error of that.";

export class ProbePair implements Coloured {
  readonly hasProbe = true;
  /** What is read off, in the place of the readings of one touch. */
  readonly root: HTMLElement;
  /** Displacement under both (s, 3) [m]: the sum of what each does alone, of the chosen order and of the highest. */
  readonly field: Float32Array;
  private readonly best: Float32Array;
  /** By the hand that holds it; null where there are not two. */
  private holding: [HeldProbe, HeldProbe] | null = null;
  private forces: [Vec3, Vec3] = [[0, 0, 0], [0, 0, 0]];
  /** Relative distance of the chosen order's field from the highest one's, and the estimated error of that. */
  private off = 0;
  private error = 0;
  private order = 1;
  private readonly grips: readonly [Grip, Grip];
  private readonly rows = NAMES.map((name) => new ProbeReadings(name));

  constructor(
    private readonly evaluator: Evaluator,
    stage: Stage,
    private readonly display: Display,
    /** Where its readings and its labels stand while two hands hold on. */
    private readonly places: { readings: HTMLElement; labels: HTMLElement },
  ) {
    const { diagonal, radius } = evaluator.about.metadata;
    this.field = new Float32Array(evaluator.rest.length);
    this.best = new Float32Array(evaluator.rest.length);
    const grip = () => new Grip(stage, display.gauge.root, diagonal, radius, radius);
    this.grips = [grip(), grip()];
    for (const { arrow } of this.grips) {
      arrow.hasProbe = true;
      stage.world.add(arrow.group);
    }
    const sides = this.rows.map(({ root }) => root);
    const words = element("p", { class: "contrast" }, WORDS);
    this.root = element("section", { class: "panel readings live is-pair", "aria-label": "two probes" }, ...sides, words);
  }

  /** Whether both hands hold one. */
  get isPlaying(): boolean {
    return this.holding !== null;
  }

  /** A second hand brings its probe to where it took hold, beside the one that presses already. */
  join({ felt, normal, outset, motion }: TouchState, hit: Hit, hand: number): void {
    const { radius } = this.evaluator.about.metadata;
    const facing = this.display.body.normalAt(hit.rest, radius);
    const center = hit.moved.toArray().map((x, i) => x + radius * facing[i]!) as Vec3;
    const here = this.holding?.[1 - hand] ?? { felt: felt!, normal, outset, motion };
    const there = { felt: { ...felt!, center }, normal: facing, outset: center, motion: [0, 0, 0] as Vec3 };
    if (this.holding) this.evaluator.endPair(1 - hand);
    this.evaluator.beginPair(1 - hand);
    this.holding = hand === 0 ? [there, here] : [here, there];
    this.renew();
    this.renew();
    this.places.readings.append(this.root);
    this.places.labels.append(...this.grips.map(({ label }) => label.root));
    this.display.isPassive = true;
  }

  /** Moves a hand to a displacement from where it took hold [m]; its probe goes along a straight line. */
  move(displacement: Vec3, hand: number): void {
    const { holding } = this;
    if (!holding) return;
    const held = holding[hand]!;
    held.motion = displacement;
    const goal = held.outset.map((x, i) => x + displacement[i]!) as Vec3;
    for (const center of strides(held.felt.center, goal, this.evaluator.about.metadata.radius)) {
      const other = holding[1 - hand]!.felt.center;
      this.place(hand === 0 ? [center, other] : [other, center]);
    }
    this.renew();
  }

  /** Outward normal where a hand took hold, and how far it has moved. */
  contact(hand: number): { normal: Vec3; displacement: Vec3 } | null {
    const held = this.holding?.[hand];
    return held ? { normal: held.normal, displacement: held.motion } : null;
  }

  /** A hand takes its probe away: the touch of the other one, which goes on alone. */
  leave(hand: number, order: number): TouchState {
    const left = this.holding![1 - hand]!;
    this.evaluator.endPair(1 - hand);
    this.end();
    return TouchState.resumed(this.evaluator, left, order);
  }

  /** Asks anew what both feel where they are: each then presses the surface as the other one left it at last. */
  renew(): void {
    this.place(this.holding!.map(({ felt }) => felt.center) as [Vec3, Vec3]);
  }

  /** Both are taken away. */
  end(): void {
    this.holding = null;
    this.root.remove();
    this.display.isPassive = false;
    for (const { arrow, label } of this.grips) {
      arrow.hide();
      label.root.remove();
    }
  }

  /** Shows both in the field of an order. */
  show(order: number): void {
    if (!this.holding) return;
    this.choose(order);
    this.holding.forEach(({ felt, normal }, k) => {
      const at = felt.point.map((x, i) => x + felt.displacement[i]!) as Vec3;
      this.grips[k]!.arrow.show(at, this.forces[k]!, normal, this.display.reference, this.standing(k), felt.center);
      this.rows[k]!.show(this.size(k), felt.gap, this.forceError(k), this.standing(k));
    });
    const isTrusted = this.holding.every(({ felt }, k) => felt.shapeTrust === "trusted" && !this.doubt(k));
    this.display.showField(this, order, this.shifts, isTrusted);
  }

  /** Writes the forces beside the probes. */
  follow(): void {
    this.grips.forEach(({ label }, k) => label.follow(this.size(k), this.standing(k)));
  }

  /** What is told beside the force of a hand. */
  reading(hand: number): Reading | null {
    if (!this.holding) return null;
    const standing = this.standing(hand);
    const at = this.grips[hand]!.arrow.endsInScene()[1];
    return { force: newtons(this.size(hand)), worth: standing === "sound" ? "trusted" : "not trusted", standing, at };
  }

  /** The forces in words, and what not to rely on. */
  get inWords(): [string, string] {
    const sizes = [0, 1].map((k) => newtons(this.size(k)));
    const doubt = [0, 1].map((k) => this.doubt(k)).find(Boolean);
    const said = [`${sizes.join(" and ")} by two probes`, ...conditions(this.evaluator, this.order)].join(", ");
    return [`${said}.`, doubt ? `Not trusted: ${doubt}.` : ""];
  }

  /** How far the parts within have moved. */
  private get shifts(): Shift[] {
    const { evaluator, field, order } = this;
    const error = this.error + (order < evaluator.about.metadata.order ? this.off : 0);
    return this.display.inside.shifts(field, error, typical(field, evaluator.outer));
  }

  /** Its part of the state in numbers: SI units. */
  get state(): Record<string, unknown> {
    const hands = this.holding!.map(({ felt, motion }, k) => ({
      center: felt.center,
      point: felt.point,
      displacement: felt.displacement,
      motion,
      gap: felt.gap,
      grip: felt.grip,
      force: this.forces[k],
      error_estimate: this.forceError(k),
      is_trusted: !this.doubt(k),
    }));
    return { hands, field: Array.from(this.field), inside: this.shifts };
  }

  /** What the first hand's probe does, to whom it is told. */
  get told(): Told {
    const { point, displacement } = this.holding![0].felt;
    return { point, displacement, force: this.forces[0], is_trusted: !this.doubt(0) };
  }

  localError(order: number, out: Float32Array): void {
    const { best, evaluator } = this;
    const highest = evaluator.about.metadata.order;
    if (order < highest) return distances(this.field, best, 1, out);
    const other = new Float32Array(best.length);
    this.add(highest - 1, other);
    spreadError(best, other, this.error, out);
  }

  dispose(): void {
    this.grips.forEach((grip) => grip.dispose());
    this.root.remove();
  }

  private place(centers: [Vec3, Vec3]): void {
    const felt = this.evaluator.placePair(centers);
    this.holding!.forEach((held, k) => (held.felt = felt[k]!));
  }

  /** Fields and forces of an order. */
  private choose(order: number): void {
    const { evaluator, field, best } = this;
    const highest = evaluator.about.metadata.order;
    this.order = order;
    const sizes = this.add(highest, best);
    if (order === highest) field.set(best);
    else this.add(order, field);
    const size = norm(best);
    this.off = size > 0 ? distance(field, best) / size : 0;
    // At worst the errors of both fields add up.
    const error = this.holding!.reduce((sum, { felt }, k) => sum + felt.shapeError * sizes[k]!, 0);
    this.error = size > 0 ? error / size : 0;
    this.forces = this.holding!.map(({ felt }, k) => {
      if (order === highest) return felt.force;
      evaluator.choose(k, felt.center);
      return evaluator.force(felt.displacement, order);
    }) as [Vec3, Vec3];
  }

  /** The sum of both fields of an order; the norm of each. */
  private add(order: number, sum: Float32Array): number[] {
    const { evaluator } = this;
    sum.fill(0);
    return this.holding!.map(({ felt }, k) => {
      evaluator.choose(k, felt.center);
      const field = evaluator.surface(felt.displacement, order, 0);
      for (let i = 0; i < sum.length; i++) sum[i]! += field[i]!;
      return norm(field);
    });
  }

  private size(hand: number): number {
    return Math.hypot(...this.forces[hand]!);
  }

  /** Relative distance of a hand's force in the chosen order from that of the highest. */
  private forceOff(hand: number): number {
    return apart(this.forces[hand]!, this.holding![hand]!.felt.force);
  }

  /** Estimated relative error of a hand's force in the chosen order. */
  private forceError(hand: number): number {
    return this.holding![hand]!.felt.error + this.forceOff(hand);
  }

  private standing(hand: number): Standing {
    return this.doubt(hand) ? "doubtful" : "sound";
  }

  private doubt(hand: number): string {
    const { metadata } = this.evaluator.about;
    const { felt } = this.holding![hand]!;
    const depth = Math.hypot(...felt.displacement);
    const distances = { off: this.off, forceOff: this.forceOff(hand) };
    const room = roomBeside(felt.error, depth, metadata, true);
    return doubtOf(felt, felt, depth, metadata) || doubtOfOrder(this.order, metadata.order, distances, room);
  }
}

/** What is read off of one of the probes. */
class ProbeReadings {
  readonly root: HTMLElement;
  private readonly force = element("span", { class: "force" });
  private readonly depth = element("span");
  private readonly error = element("span");

  constructor(name: string) {
    this.root = element(
      "section",
      { class: "specimen", "aria-label": name },
      element("span", { class: "standing" }, name),
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, fact("entered", this.depth), fact("est. force error", this.error)),
    );
  }

  show(force: number, gap: number, error: number, standing: Standing): void {
    write(this.force, newtons(force).slice(0, -2));
    write(this.depth, depthInWords(Math.max(0, -gap)));
    write(this.error, percent(error));
    this.root.classList.toggle("is-doubtful", standing === "doubtful");
  }
}
