// Where a view stands in its place: a shadow tree with the canvas, and panels at the edges that leave a clearing.
import { element } from "../base/dom";
import style from "../style/index.css?inline";

export class Plan {
  readonly canvas = element("canvas", { class: "stage", tabindex: "0", role: "application" });
  readonly root: HTMLElement;
  private readonly host = element("div", { style: "position:absolute;inset:0" });

  constructor(
    title: string,
    gesture: string,
    private readonly isEmbedded: boolean,
  ) {
    this.canvas.setAttribute("aria-label", `${title}. ${gesture} E, S, D and X turn the view. Press ? for the keys.`);
    this.root = element("div", { class: isEmbedded ? "view is-embedded" : "view" }, this.canvas);
    this.host.attachShadow({ mode: "open" }).append(element("style", {}, style), this.root);
  }

  /** Fills a place: what floats above the organ, the panels around it, and what is beside the plan. */
  fill(place: HTMLElement, floating: readonly HTMLElement[], panels: readonly HTMLElement[], beside: readonly HTMLElement[]): void {
    this.root.append(...floating, element("div", { class: "plan" }, ...panels), ...beside);
    place.append(this.host);
  }

  /** Whether the wheel is meant for the view. */
  get isInUse(): boolean {
    return !this.isEmbedded || (document.hasFocus() && this.root.matches(":focus-within"));
  }

  /** Makes the keys work. */
  focus(): void {
    this.canvas.focus({ preventScroll: true });
  }

  remove(): void {
    this.host.remove();
  }
}
