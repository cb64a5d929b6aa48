// The organs of a case in a row: one, or one for each of two laws, side by side.
import type * as THREE from "three";
import type { Hit, Surface } from "../stage/body";
import type { Vec3 } from "../model/evaluator";
import { lawName } from "../model/lawname";
import type { Hello } from "./hello";
import { Specimen, type Hand } from "./specimen";
import type { Stage } from "../stage/stage";

/** From the middle of one to that of the next, in widths of the organ. */
const APART = 1.15;

/** What is shown beside the organs. */
interface Shown {
  readonly hasOutline: boolean;
  readonly hasProbe: boolean;
}

export class Row {
  specimens: Specimen[] = [];
  /** Whether the first view is to take in what the loads of the case make of the organs. */
  private isExpecting = false;
  /** The largest force since a hand took hold [N]: the longest arrow. */
  private peak = 0;

  constructor(
    private readonly stage: Stage,
    private readonly surface: Surface,
    /** Of the contact patch of a hand [m], and every law and every organ of a scene that may be chosen. */
    private readonly about: Pick<Hello, "radius" | "laws" | "organs">,
    /** Holds what is written beside the arrows, and what it may not hide. */
    private readonly labels: HTMLElement,
    private readonly gauge: HTMLElement,
  ) {}

  /** Makes the organs anew, one for each law; `choose` is told which of them is given another law. */
  arrange(laws: readonly string[], shown: Shown, choose: (index: number, law: string) => void): void {
    const isOther = laws.length !== this.specimens.length;
    for (const specimen of this.specimens) {
      this.stage.world.remove(specimen.place);
      specimen.dispose();
    }
    const names = this.about.laws.map((law) => [law, lawName(law)] as [string, string]);
    const places = this.places(laws.length);
    this.specimens = laws.map((law, k) => {
      const side = laws.length > 1 ? (["left", "right"][k] ?? "") : "";
      const specimen = new Specimen(this.surface, this.about.radius, this.stage, this.gauge, names, law, side, (chosen) => choose(k, chosen));
      specimen.place.position.set(...places[k]!);
      specimen.body.outline.visible = shown.hasOutline;
      specimen.hasProbe = shown.hasProbe;
      this.stage.world.add(specimen.place);
      this.labels.append(...specimen.grips.map(({ label }) => label.root));
      return specimen;
    });
    if (!isOther) return;
    this.enclose();
    this.isExpecting = true;
  }

  /** Takes a frame; false for one that was under way when the laws changed, which is of another number of organs. */
  take(numbers: Float32Array): boolean {
    const { specimens } = this;
    if (numbers[0] !== specimens.length) return false;
    const size = (numbers.length - 1) / specimens.length;
    specimens.forEach((specimen, k) => specimen.take(numbers.subarray(1 + k * size, 1 + (k + 1) * size)));
    return true;
  }

  /** What the last frame took for all of them [ms]. */
  get milliseconds(): number {
    return this.specimens.reduce((sum, { facts }) => sum + facts.milliseconds, 0);
  }

  /** Whether the organs have come to where the loads hold them. */
  get hasSettled(): boolean {
    return this.specimens.every(({ hasSettled }) => hasSettled);
  }

  /** Back to the first view, of organs that begin anew. */
  goHome(): void {
    this.stage.goHome();
    this.isExpecting = true;
  }

  /** Shapes the organs as the last frame says. Once they have settled the first view is theirs, unless a hand has been faster. */
  present(isHeld: boolean): void {
    this.specimens.forEach((specimen) => specimen.present());
    this.isExpecting &&= !isHeld && this.stage.isHome;
    if (!this.isExpecting || !this.hasSettled) return;
    this.isExpecting = false;
    this.enclose();
  }

  /** The forces of what hands do from now on set the length of the arrows. */
  begin(): void {
    this.peak = 0;
  }

  /** Draws the forces of the hands that hold the organs, all to one scale. */
  hold(hands: readonly (Hand | null)[]): void {
    // A force on its way may be of any size: it does not set the scale.
    const settled = this.specimens.filter(({ facts }) => facts.isSettled);
    this.peak = Math.max(this.peak, ...settled.flatMap(({ sizes }) => sizes));
    const reference = this.peak || Math.max(...this.specimens.flatMap(({ sizes }) => sizes));
    this.specimens.forEach((specimen) => specimen.hold(hands, reference));
  }

  /** Marks where a hand would take hold. */
  hover({ rest, organ }: Hit): void {
    const normal = this.specimens[0]!.body.normalAt(rest, this.about.radius, organ);
    this.specimens.forEach((specimen) => specimen.hover(rest, normal, organ));
  }

  /** Nothing is seen of hands that hold nothing. */
  hide(hands: readonly (Hand | null)[]): void {
    hands.forEach((held, hand) => held ?? this.specimens.forEach((specimen) => specimen.letGo(hand)));
  }

  /** The outward normal where a hand takes hold at a point at rest [m], of an organ of a scene. */
  normalAt(point: Vec3, organ?: string): Vec3 {
    const { radius, organs } = this.about;
    return this.specimens[0]!.body.normalAt(point, radius, organ === undefined ? undefined : organs?.indexOf(organ));
  }

  /** The middle of the first organ at rest, where it stands [m]. */
  get middle(): Vec3 {
    return this.standing(this.stage.centre).toArray();
  }

  /** Where a point of the first organ at rest [m] is on the canvas, in CSS pixels. */
  project(point: Vec3): { x: number; y: number } {
    return this.stage.project(this.standing(point));
  }

  private standing(point: Vec3): THREE.Vector3 {
    return this.specimens[0]!.place.position.clone().add({ x: point[0], y: point[1], z: point[2] });
  }

  /** Takes the organs into the first view, as they are. */
  private enclose(): void {
    this.stage.enclose(this.specimens.map(({ moved, place }) => ({ points: moved, at: place.position.toArray() })));
  }

  /** What a ray meets of the organs, the nearest first. */
  hit(ray: THREE.Raycaster): Hit | null {
    const hits = this.specimens.flatMap((specimen) => {
      const hit = specimen.hit(ray);
      return hit ? [{ ...hit, moved: hit.moved.add(specimen.place.position) }] : [];
    });
    const from = this.stage.world.worldToLocal(ray.ray.origin.clone());
    return hits.sort((a, b) => a.moved.distanceToSquared(from) - b.moved.distanceToSquared(from))[0] ?? null;
  }

  /** Where so many organs stand [m]: about the middle, along the screen of the first view. */
  private places(count: number): Vec3[] {
    const { right } = this.stage;
    const { rest } = this.surface;
    let [low, high] = [Infinity, -Infinity];
    for (let n = 0; n < rest.length; n += 3) {
      const along = right[0] * rest[n]! + right[1] * rest[n + 1]! + right[2] * rest[n + 2]!;
      [low, high] = [Math.min(low, along), Math.max(high, along)];
    }
    return Array.from({ length: count }, (_, k) => right.map((r) => r * (k - 0.5 * (count - 1)) * APART * (high - low)) as Vec3);
  }
}
