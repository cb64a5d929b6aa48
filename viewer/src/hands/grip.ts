// A hand on an organ: its force as an arrow, or a probe, and a number beside it.
import { Arrow } from "../stage/arrow";
import { ForceLabel } from "../stage/label";
import type { Stage } from "../stage/stage";

export class Grip {
  readonly arrow: Arrow;
  readonly label: ForceLabel;

  /** Of an organ so large that is touched in patches of a radius; its label leaves free what is at the foot [m]. */
  constructor(stage: Stage, gauge: HTMLElement, diagonal: number, radius: number, tip = 0.5 * radius) {
    this.arrow = new Arrow(diagonal, 0.5 * radius, tip);
    this.label = new ForceLabel(stage, this.arrow, gauge);
  }

  dispose(): void {
    this.arrow.dispose();
    this.label.root.remove();
  }
}
