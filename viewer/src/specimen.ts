// An organ under one law: on the stage with its arrow, and in the readings.
import * as THREE from "three";
import { Arrow, type Standing } from "./arrow";
import { Body, type Surface } from "./body";
import { VIRIDIS } from "./colour";
import { choice, digits, element, fact, fixed, newtons } from "./dom";
import type { Vec3 } from "./evaluator";
import { ForceLabel } from "./label";
import type { Stage } from "./stage";

/** Numbers of a body in a frame before its displacements (live/src/lib.rs). */
export const FACTS = 11;

/** A hand: where it took hold at rest, the outward normal there, and how far it has moved [m]. */
export interface Hand {
  point: Vec3;
  normal: Vec3;
  displacement: Vec3;
}

/** What a frame says of an organ (live/src/lib.rs). */
interface Facts {
  force: Vec3;
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
  residual: 1,
  taken: 1,
  isUnstable: false,
  milliseconds: 0,
  gain: 0,
  isSettled: false,
  cellsAtBound: 0,
  steps: 0,
};

export class Specimen {
  readonly body: Body;
  readonly arrow: Arrow;
  readonly label: ForceLabel;
  readonly place = new THREE.Group();
  readonly root: HTMLElement;
  facts: Facts = { ...AT_REST };
  field: Float32Array;
  private readonly force = element("span", { class: "force" }, "0.00");
  private readonly volume = element("span");
  private readonly residual = element("span");
  private readonly time = element("span");

  constructor(
    private readonly surface: Surface,
    radius: number,
    stage: Stage,
    laws: readonly [string, string][],
    readonly law: string,
    /** Where it stands beside another. */
    side: string,
    choose: (law: string) => void,
  ) {
    this.body = new Body(surface);
    this.arrow = new Arrow(surface.diagonal, 0.5 * radius);
    this.label = new ForceLabel(stage, this.arrow);
    this.place.add(this.body.mesh, this.body.outline, this.arrow.group);
    this.field = new Float32Array(surface.rest.length);
    this.label.root.dataset.side = side;
    const select = choice("law", laws, choose);
    select.value = law;
    this.root = element(
      "section",
      { class: "specimen", "aria-label": side ? `${law}, ${side}` : law },
      element("div", { class: "row" }, select, ...(side ? [element("span", { class: "standing" }, side)] : [])),
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, fact("volume", this.volume), fact("residual", this.residual), fact("a frame", this.time)),
    );
  }

  /** Takes its part of a frame; what is seen of it follows when it is drawn. */
  take(numbers: Float32Array): void {
    const [fx, fy, fz, residual, taken, unstable, milliseconds, gain, settled, bound, steps] = numbers as unknown as number[];
    this.facts = {
      force: [fx!, fy!, fz!],
      residual: residual!,
      taken: taken!,
      isUnstable: unstable === 1,
      milliseconds: milliseconds!,
      gain: gain!,
      isSettled: settled === 1,
      cellsAtBound: bound!,
      steps: steps!,
    };
    this.field = numbers.slice(FACTS);
  }

  /** Shapes the organ and writes the numbers of the last frame. */
  present(): void {
    const { residual, milliseconds, gain } = this.facts;
    this.body.move(this.field);
    this.force.textContent = newtons(this.size).slice(0, -2);
    this.volume.textContent = `${gain > 0 ? "+" : ""}${fixed(100 * gain, 2)} %`;
    this.volume.classList.toggle("is-wrong", Math.abs(gain) > 0.01);
    this.residual.textContent = residual > 0 ? residual.toExponential(0).replace("-", "−") : "0";
    this.time.textContent = `${digits(milliseconds, 2)} ms`;
    for (const name of ["doubtful", "unsettled"]) this.root.classList.toggle(`is-${name}`, this.standing === name);
  }

  /** The force of the hand [N]. */
  get size(): number {
    return Math.hypot(...this.facts.force);
  }

  /** What the force is worth. */
  get standing(): Standing {
    const { isSettled, isUnstable, cellsAtBound } = this.facts;
    if (!isSettled) return "unsettled";
    return isUnstable || cellsAtBound > 0 ? "doubtful" : "sound";
  }

  /** Draws the hand's force, as long as its share of a reference. */
  hold(hand: Hand, reference: number): void {
    const at = hand.point.map((x, i) => x + hand.displacement[i]!) as Vec3;
    this.arrow.show(at, this.facts.force, hand.normal, Math.max(reference, 1e-9), this.standing);
  }

  /** Marks where a hand would take hold. */
  hover(point: Vec3, normal: Vec3): void {
    const moved = this.displacementAt(point);
    this.arrow.hover(point.map((x, i) => x + moved[i]!) as Vec3, normal);
  }

  /** The largest displacement of a node [m]. */
  get reach(): number {
    return this.lengths().reduce((most, x) => Math.max(most, x), 0);
  }

  /** Colours by displacement up to a length [m]. */
  colour(longest: number): void {
    this.body.paint(this.lengths(), 0, longest, VIRIDIS);
  }

  private lengths(): Float32Array {
    const { field } = this;
    return Float32Array.from({ length: field.length / 3 }, (_, n) => Math.hypot(...field.subarray(3 * n, 3 * n + 3)));
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
