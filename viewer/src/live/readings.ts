// What is read off of stepped organs: each one's numbers, how far two are apart, and the button from one to two.
import { Contrast } from "./contrast";
import { button, element } from "../base/dom";
import type { Specimen } from "./specimen";

export class LiveReadings {
  readonly root = element("section", { class: "panel readings live", "aria-label": "readings" });
  private readonly contrast = new Contrast();

  constructor(
    /** Every law that may be chosen. */
    private readonly laws: readonly string[],
    private readonly setLaws: (laws: string[]) => void,
  ) {}

  /** Shows the organs of one law, or of two. */
  arrange(specimens: readonly Specimen[]): void {
    const focused = this.controls.indexOf((this.root.getRootNode() as ShadowRoot).activeElement as HTMLElement);
    const isLast = focused === this.controls.length - 1;
    const contrast = specimens.length > 1 ? [this.contrast.root] : [];
    const pairing = this.laws.length > 1 ? [this.pairing(specimens)] : [];
    this.root.replaceChildren(...specimens.map(({ root }) => root), ...contrast, ...pairing);
    // Whoever has chosen a law, or a second one, by key goes on from there.
    if (focused >= 0) this.controls.at(isLast ? -1 : focused)!.focus({ preventScroll: true });
    this.root.classList.toggle("is-pair", specimens.length > 1);
  }

  /** How far two organs are apart. */
  show([one, other]: readonly Specimen[]): void {
    if (one && other) this.contrast.show(one, other);
  }

  /** The lists of laws and the button below them. */
  private get controls(): HTMLElement[] {
    return [...this.root.querySelectorAll<HTMLElement>("select, button")];
  }

  private pairing(specimens: readonly Specimen[]): HTMLButtonElement {
    const first = specimens[0]!.law;
    const isPair = specimens.length > 1;
    const other = first === "Linear" ? (this.laws.find((law) => law !== first) ?? first) : "Linear";
    return button(isPair ? "One organ" : "Compare two laws", "show one organ, or compare two laws in the same hand", () =>
      this.setLaws(isPair ? [first] : [first, other]),
    );
  }
}
