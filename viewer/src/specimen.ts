// An organ under one law: on the stage with its arrow, and in the readings.
import * as THREE from "three";
import { Arrow } from "./arrow";
import { Body, type Surface } from "./body";
import { VIRIDIS } from "./colour";
import { choice, digits, element, fixed, newtons } from "./dom";
import type { Vec3 } from "./evaluator";
import { ForceLabel } from "./label";
import type { Stage } from "./stage";

/** Numbers of a body in a frame before its displacements (live/src/lib.rs). */
export const FACTS = 8;

/** A hand: where it took hold at rest, the outward normal there, and how far it has moved [m]. */
export interface Hand {
  point: Vec3;
  normal: Vec3;
  displacement: Vec3;
}

export class Specimen {
  readonly body: Body;
  readonly arrow: Arrow;
  readonly label: ForceLabel;
  readonly place = new THREE.Group();
  readonly root: HTMLElement;
  facts = { force: [0, 0, 0] as Vec3, residual: 1, taken: 1, isUnstable: false, milliseconds: 0, gain: 0 };
  field: Float32Array;
  private readonly force = element("output", { class: "force" }, "0.00");
  private readonly volume = element("output");
  private readonly residual = element("output");
  private readonly time = element("output");

  constructor(
    private readonly surface: Surface,
    radius: number,
    stage: Stage,
    laws: readonly [string, string][],
    readonly law: string,
    choose: (law: string) => void,
  ) {
    this.body = new Body(surface);
    this.arrow = new Arrow(surface.diagonal, 0.5 * radius);
    this.label = new ForceLabel(stage, this.arrow);
    this.place.add(this.body.mesh, this.body.outline, this.arrow.group);
    this.field = new Float32Array(surface.rest.length);
    const select = choice("law", laws, choose);
    select.value = law;
    const fact = (name: string, value: HTMLElement) => element("div", {}, element("dt", {}, name), element("dd", {}, value));
    this.root = element(
      "section",
      { class: "specimen", "aria-label": law },
      select,
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, fact("volume", this.volume), fact("residual", this.residual), fact("a frame", this.time)),
    );
  }

  /** Takes its part of a frame. */
  take(numbers: Float32Array): void {
    const [fx, fy, fz, residual, taken, unstable, milliseconds, gain] = numbers as unknown as number[];
    this.facts = {
      force: [fx!, fy!, fz!],
      residual: residual!,
      taken: taken!,
      isUnstable: unstable === 1,
      milliseconds: milliseconds!,
      gain: gain!,
    };
    this.field = numbers.slice(FACTS);
    this.body.move(this.field);
    this.force.textContent = newtons(this.size).slice(0, -2);
    this.volume.textContent = `${gain! > 0 ? "+" : ""}${fixed(100 * gain!, 2)} %`;
    this.volume.classList.toggle("is-wrong", Math.abs(gain!) > 0.01);
    this.residual.textContent = residual! > 0 ? residual!.toExponential(0).replace("-", "−") : "0";
    this.time.textContent = `${digits(milliseconds!, 2)} ms`;
  }

  /** The force of the hand [N]. */
  get size(): number {
    return Math.hypot(...this.facts.force);
  }

  /** Whether the frame went as it should. */
  get isSound(): boolean {
    return this.facts.taken === 1 && !this.facts.isUnstable;
  }

  /** Draws the hand's force, as long as its share of a reference. */
  hold(hand: Hand, reference: number): void {
    const at = hand.point.map((x, i) => x + hand.displacement[i]!) as Vec3;
    this.arrow.show(at, this.facts.force, hand.normal, Math.max(reference, 1e-9), this.isSound);
  }

  /** Marks where a hand would take hold. */
  hover(point: Vec3, normal: Vec3): void {
    const moved = this.displacementAt(point);
    this.arrow.hover(point.map((x, i) => x + moved[i]!) as Vec3, normal);
  }

  /** Colours by displacement up to a length [m]. */
  colour(longest: number): void {
    const { field } = this;
    const lengths = Float32Array.from({ length: field.length / 3 }, (_, n) => Math.hypot(...field.subarray(3 * n, 3 * n + 3)));
    this.body.paint(lengths, 0, longest, VIRIDIS);
  }

  /** Displacement of the node closest to a point at rest: where a hand takes hold of a deformed organ. */
  displacementAt(point: Vec3): Vec3 {
    const { rest } = this.surface;
    let [best, least] = [0, Infinity];
    for (let n = 0; n < rest.length; n += 3) {
      const distance = Math.hypot(rest[n]! - point[0], rest[n + 1]! - point[1], rest[n + 2]! - point[2]);
      if (distance < least) [best, least] = [n, distance];
    }
    return [...this.field.subarray(best, best + 3)] as Vec3;
  }

  dispose(): void {
    this.arrow.dispose();
    this.body.dispose();
    this.label.root.remove();
  }
}
