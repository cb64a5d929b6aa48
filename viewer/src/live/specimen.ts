// An organ under one law: on the stage with its arrow, and in the readings.
import * as THREE from "three";
import type { Standing } from "../stage/arrow";
import { Body, lookOver, type Hit, type Surface } from "../stage/body";
import { choice, digits, element, fact, fixed, newtons, write } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { displacementAt, lengths } from "../model/field";
import { Grip } from "../hands/grip";
import type { Reading } from "../hands/pointer";
import type { Stage } from "../stage/stage";
import { Surroundings } from "../stage/surroundings";
import type { Told } from "../touch/told";

/** Numbers of a body in a frame before its displacements (live/src/lib.rs). */
export const FACTS = 14;

/** A hand: where it took hold at rest, the outward normal there, and how far it has moved [m]. */
export interface Hand {
  point: Vec3;
  normal: Vec3;
  displacement: Vec3;
  /** Of a scene, the name of the organ that it holds. */
  organ?: string;
}

/** What a frame says of an organ (live/src/lib.rs). */
interface Facts {
  /** Of the first hand, and of the second [N]. */
  force: Vec3;
  second: Vec3;
  residual: number;
  /** Part of the last step that was taken. */
  taken: number;
  isUnstable: boolean;
  milliseconds: number;
  /** Relative change of volume. */
  gain: number;
  /** Whether force and shape are those of equilibrium. */
  isSettled: boolean;
  /** Cells that are squeezed or stretched as far as a cell may be. */
  cellsAtBound: number;
  /** Newton iterations. */
  steps: number;
}

const AT_REST: Facts = {
  force: [0, 0, 0],
  second: [0, 0, 0],
  residual: 1,
  taken: 1,
  isUnstable: false,
  milliseconds: 0,
  gain: 0,
  isSettled: false,
  cellsAtBound: 0,
  steps: 0,
};

/** Below this residual no more frames are asked for. */
const STILL = 1e-8;

/** What a force is worth, in words. */
export const WORTH: Record<Standing, string> = { sound: "settled", doubtful: "doubtful", unsettled: "not settled" };

export class Specimen {
  readonly body: Body;
  /** Of the first hand and of the second. */
  readonly grips: readonly [Grip, Grip];
  readonly place = new THREE.Group();
  readonly surroundings: Surroundings;
  readonly root: HTMLElement;
  facts: Facts = { ...AT_REST };
  /** Whether a frame has settled: the organ has come to where its loads and the hands hold it. */
  hasSettled = false;
  field: Float32Array;
  /** Von Mises stress at the nodes (s,) [Pa]; empty where no frame has brought it. */
  stress = new Float32Array(0);
  private poses = new Float32Array(0);
  private readonly lengths: Float32Array;
  private readonly force = element("span", { class: "force" }, "0.00");
  private readonly second = element("span");
  private readonly secondFact = fact("second hand", this.second);
  private readonly volume = element("span");
  private readonly residual = element("span");
  private readonly time = element("span");

  constructor(
    private readonly surface: Surface,
    radius: number,
    stage: Stage,
    gauge: HTMLElement,
    laws: readonly [string, string][],
    readonly law: string,
    /** Where it stands beside another. */
    side: string,
    choose: (law: string) => void,
  ) {
    this.body = new Body(surface);
    const { centre } = lookOver(surface);
    this.surroundings = new Surroundings(surface.around ?? { bodies: [], springs: 0 }, surface.diagonal, centre);
    const grip = () => new Grip(stage, gauge, surface.diagonal, radius);
    this.grips = [grip(), grip()];
    this.grips.forEach(({ label }) => (label.root.dataset.side = side));
    this.place.add(this.body.mesh, this.body.outline, this.surroundings.group, ...this.grips.map(({ arrow }) => arrow.group));
    this.field = new Float32Array(surface.rest.length);
    this.lengths = new Float32Array(surface.rest.length / 3);
    const select = choice("law", laws, choose);
    select.value = law;
    this.root = element(
      "section",
      { class: "specimen", "aria-label": side ? `${law}, ${side}` : law },
      element("div", { class: "row" }, select, ...(side ? [element("span", { class: "standing" }, side)] : [])),
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, this.secondFact, fact("volume change", this.volume), fact("residual", this.residual), fact("time per frame", this.time)),
    );
    this.secondFact.hidden = true;
  }

  /** Takes its part of a frame; what is seen of it follows when it is drawn. */
  take(numbers: Float32Array): void {
    const [fx, fy, fz, residual, taken, unstable, milliseconds, gain, settled, bound, steps] = numbers;
    const [sx, sy, sz] = numbers.subarray(FACTS - 3, FACTS);
    this.facts = {
      force: [fx!, fy!, fz!],
      second: [sx!, sy!, sz!],
      residual: residual!,
      taken: taken!,
      isUnstable: unstable === 1,
      milliseconds: milliseconds!,
      gain: gain!,
      isSettled: settled === 1,
      cellsAtBound: bound!,
      steps: steps!,
    };
    this.hasSettled ||= this.facts.isSettled;
    const end = FACTS + this.field.length;
    const last = end + this.surroundings.size;
    this.field = numbers.slice(FACTS, end);
    this.poses = numbers.slice(end, last);
    this.stress = numbers.slice(last);
  }

  /** No frame has come of what is held now, or none comes any more: the force of the last one is that of no hand. */
  lose(): void {
    this.facts.isSettled = false;
  }

  /** Shapes the organ and writes the numbers of the last frame. */
  present(): void {
    const { residual, milliseconds, gain } = this.facts;
    this.body.move(this.field);
    this.surroundings.place(this.poses);
    write(this.force, newtons(this.size).slice(0, -2));
    write(this.second, newtons(this.sizes[1]!));
    write(this.volume, `${gain > 0 ? "+" : ""}${fixed(100 * gain, 2)} %`);
    this.volume.classList.toggle("is-wrong", Math.abs(gain) > 0.01);
    write(this.residual, residual > 0 ? residual.toExponential(0).replace("-", "−") : "0");
    write(this.time, `${digits(milliseconds, 2)} ms`);
    for (const name of ["doubtful", "unsettled"]) this.root.classList.toggle(`is-${name}`, this.standing === name);
  }

  /** Whether further frames bring it closer to equilibrium. */
  get isMoving(): boolean {
    const { residual, taken, isSettled } = this.facts;
    return residual > STILL || taken < 1 || !isSettled;
  }

  /** The force of the first hand [N]. */
  get size(): number {
    return this.sizes[0]!;
  }

  /** The forces of both hands [N]. */
  get sizes(): [number, number] {
    return [Math.hypot(...this.facts.force), Math.hypot(...this.facts.second)];
  }

  /** What the force is worth; `is_sound` in python/viscera/viewer/stepped.py says the same of a touch from Python. */
  get standing(): Standing {
    const { isSettled, isUnstable, cellsAtBound } = this.facts;
    if (!isSettled) return "unsettled";
    return isUnstable || cellsAtBound > 0 ? "doubtful" : "sound";
  }

  /** Draws the forces of the hands that hold it, as long as their share of a reference. */
  hold(hands: readonly (Hand | null)[], reference: number): void {
    const { force, second } = this.facts;
    this.grips.forEach(({ arrow }, k) => {
      const hand = hands[k];
      if (!hand) return;
      const at = hand.point.map((x, i) => x + hand.displacement[i]!) as Vec3;
      arrow.show(at, k === 0 ? force : second, hand.normal, Math.max(reference, 1e-9), this.standing);
    });
    this.secondFact.hidden = !hands[1];
  }

  /** A hand as the last frame found it, to whom it is told; what the page marks is not trusted. */
  told({ point, displacement }: Hand, hand: number): Told {
    const { force, second } = this.facts;
    return { point, displacement, force: hand === 0 ? force : second, is_trusted: this.standing === "sound" };
  }

  /** What is told beside the force of a hand. */
  reading(hand: number): Reading {
    const { standing } = this;
    const at = this.grips[hand]!.arrow.endsInScene()[1];
    return { force: newtons(this.sizes[hand]!), worth: WORTH[standing], standing, at };
  }

  /** Whether probes stand where the forces' arrows do. */
  set hasProbe(isProbe: boolean) {
    this.grips.forEach(({ arrow }) => (arrow.hasProbe = isProbe));
  }

  /** A hand has let go. */
  letGo(hand: number): void {
    this.grips[hand]!.arrow.hide();
    if (hand === 1) this.secondFact.hidden = true;
  }

  /** Writes the forces beside their arrows. */
  follow(): void {
    this.grips.forEach(({ label }, k) => label.follow(this.sizes[k]!, this.standing));
  }

  /** What a ray meets of the organ; nothing, where a rigid body stands before it. */
  hit(ray: THREE.Raycaster): Hit | null {
    const hit = this.body.hit(ray);
    if (!hit) return null;
    const far = ray.ray.origin.distanceTo(this.place.localToWorld(hit.moved.clone()));
    return this.surroundings.hides(ray, far) ? null : hit;
  }

  /** Marks where a hand would take hold. */
  hover(point: Vec3, normal: Vec3, organ?: number): void {
    const moved = this.displacementAt(point, organ);
    this.grips[0].arrow.hover(point.map((x, i) => x + moved[i]!) as Vec3, normal);
  }

  /** Where every node is (s, 3) [m]. */
  get moved(): Float32Array {
    return this.surface.rest.map((x, i) => x + this.field[i]!);
  }

  /** How far every node has moved (s,) [m]. */
  distances(): Float32Array {
    lengths(this.field, this.lengths);
    return this.lengths;
  }

  /** Displacement of the node closest to a point at rest, of an organ: where a hand takes hold of what is deformed. */
  displacementAt(point: Vec3, organ?: number): Vec3 {
    const { rest, organOf } = this.surface;
    return displacementAt(rest, this.field, point, (node) => organ === undefined || organOf?.[node] === organ);
  }

  dispose(): void {
    this.grips.forEach((grip) => grip.dispose());
    this.body.dispose();
    this.surroundings.dispose();
  }
}
