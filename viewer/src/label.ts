// The force in newtons beside its arrow.
import type { Arrow } from "./arrow";
import { element, newtons } from "./dom";
import type { Stage } from "./stage";

export class ForceLabel {
  readonly root = element("div", { class: "force-label", "aria-hidden": "true" });

  constructor(
    private readonly stage: Stage,
    private readonly arrow: Arrow,
  ) {
    this.root.hidden = true;
  }

  /** Follows the arrow's far end; nothing is shown where there is no arrow. */
  follow(force: number, isTrusted: boolean): void {
    this.root.hidden = !this.arrow.hasForce;
    if (this.root.hidden) return;
    const { x, y } = this.stage.onCanvas(this.arrow.tailInScene());
    this.root.style.transform = `translate(${x}px, ${y}px) translate(-50%, -130%)`;
    this.root.textContent = newtons(force);
    this.root.classList.toggle("is-doubtful", !isTrusted);
  }
}
