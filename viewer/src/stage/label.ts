// The force in newtons beside its arrow.
import type { Arrow, Standing } from "./arrow";
import { element, newtons, write } from "../base/dom";
import type { Stage } from "./stage";

type Place = { x: number; y: number };

/** From the arrow's far end to the middle of its label, at its side and below or above [px]. */
const WIDE = 52;
const HIGH = 24;

export class ForceLabel {
  readonly root = element("div", { class: "force-label", "aria-hidden": "true", "data-side": "" });

  constructor(
    private readonly stage: Stage,
    private readonly arrow: Arrow,
    /** What it may not hide, at the foot of the clearing. */
    private readonly gauge: HTMLElement,
  ) {
    this.root.hidden = true;
  }

  /** Follows the arrow's far end; nothing is shown where there is no arrow. */
  follow(force: number, standing: Standing): void {
    this.root.hidden = !this.arrow.hasForce;
    if (this.root.hidden) return;
    const [foot, tail] = this.arrow.endsInScene().map((point) => this.stage.onCanvas(point)) as [Place, Place];
    // Beyond the far end, so that it hides neither the arrow nor the contact.
    const [dx, dy] = [tail.x - foot.x, tail.y - foot.y];
    const size = Math.hypot(dx, dy);
    const [x, y] = size > 1 ? [tail.x + (WIDE * dx) / size, tail.y + (HIGH * dy) / size] : [tail.x, tail.y - HIGH];
    const { offsetLeft, offsetTop, clientWidth, clientHeight } = this.stage.clearing;
    write(this.root, newtons(force));
    const half = Math.max(WIDE, 0.5 * this.root.offsetWidth);
    const left = within(x, half, offsetLeft, clientWidth);
    const { gauge } = this;
    const isOver = left - half < gauge.offsetLeft + gauge.offsetWidth && left + half > gauge.offsetLeft;
    const top = within(y, HIGH, offsetTop, clientHeight - (isOver ? gauge.offsetHeight : 0));
    this.root.style.transform = `translate(${left}px, ${top}px) translate(-50%, -50%)`;
    for (const name of ["doubtful", "unsettled"]) this.root.classList.toggle(`is-${name}`, standing === name);
  }
}

/** Moved so far that a margin remains at both ends of an interval. */
function within(place: number, margin: number, start: number, size: number): number {
  return Math.max(start + margin, Math.min(place, start + size - margin));
}
