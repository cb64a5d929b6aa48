// The organs of a case in a row: one, or one for each of two laws, side by side.
import type * as THREE from "three";
import type { Hit, Surface } from "../stage/body";
import type { Vec3 } from "../model/evaluator";
import { lawName } from "../model/lawname";
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
    private readonly radius: number,
    /** Every law that may be chosen. */
    private readonly laws: readonly string[],
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
    const names = this.laws.map((law) => [law, lawName(law)] as [string, string]);
    const places = this.places(laws.length);
    this.specimens = laws.map((law, k) => {
      const side = laws.length > 1 ? (["left", "right"][k] ?? "") : "";
      const specimen = new Specimen(this.surface, this.radius, this.stage, this.gauge, names, law, side, (chosen) => choose(k, chosen));
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
