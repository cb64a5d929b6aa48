// How two organs differ in the same hand.
import { depthInWords, element, fact, percent } from "../base/dom";
import type { Specimen } from "./specimen";

export class Contrast {
  private readonly apart = element("span");
  private readonly shape = element("span");
  private readonly force = element("span");
  readonly root: HTMLElement;

  constructor() {
    const facts = [fact("distance", this.apart), fact("difference in shape", this.shape), fact("difference in force", this.force)];
    this.root = element("dl", { class: "contrast", "aria-label": "difference between the two laws" }, ...facts);
  }

  /** The largest distance of a node, its share of the largest displacement, and the share of the first one's force. */
  show(one: Specimen, other: Specimen): void {
    let [distance, largest] = [0, 0];
    for (let n = 0; n < one.field.length; n += 3) {
      const [a, b] = [one.field.subarray(n, n + 3), other.field.subarray(n, n + 3)];
      distance = Math.max(distance, Math.hypot(a[0]! - b[0]!, a[1]! - b[1]!, a[2]! - b[2]!));
      largest = Math.max(largest, Math.hypot(...a), Math.hypot(...b));
    }
    const off = Math.hypot(...one.facts.force.map((f, i) => f - other.facts.force[i]!));
    this.apart.textContent = depthInWords(distance);
    this.shape.textContent = largest > 0 ? percent(distance / largest) : "–";
    this.force.textContent = one.size > 0 ? percent(off / one.size) : "–";
  }
}
