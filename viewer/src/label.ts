// The force in newtons beside its arrow.
import type { Arrow } from "./arrow";
import { element, newtons } from "./dom";
import type { Stage } from "./stage";

type Place = { x: number; y: number };

/** From the arrow's far end to the middle of its label, at its side and below or above [px]. */
const WIDE = 52;
const HIGH = 24;

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
    const [foot, tail] = this.arrow.endsInScene().map((point) => this.stage.onCanvas(point)) as [Place, Place];
    // Beyond the far end, so that it hides neither the arrow nor the contact.
    const [dx, dy] = [tail.x - foot.x, tail.y - foot.y];
    const size = Math.hypot(dx, dy);
    const [x, y] = size > 1 ? [tail.x + (WIDE * dx) / size, tail.y + (HIGH * dy) / size] : [tail.x, tail.y - HIGH];
    const { clientWidth, clientHeight } = this.stage.canvas;
    const [left, top] = [within(x, WIDE, clientWidth), within(y, HIGH, clientHeight)];
    this.root.style.transform = `translate(${left}px, ${top}px) translate(-50%, -50%)`;
    this.root.textContent = newtons(force);
    this.root.classList.toggle("is-doubtful", !isTrusted);
  }
}

/** Moved so far that a margin remains at both ends. */
function within(place: number, margin: number, size: number): number {
  return Math.max(margin, Math.min(place, size - margin));
}
