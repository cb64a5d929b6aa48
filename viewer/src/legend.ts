// What the colours mean: a gradient with its ends.
import { gradient, type ColourMap } from "./colour";
import { digits, element } from "./dom";

export class Legend {
  readonly root = element("div", { class: "panel legend" });
  private readonly name = element("span", { class: "legend-name" });
  private readonly bar = element("div", { class: "legend-bar" });
  private readonly ticks = element("div", { class: "legend-ticks" });

  constructor() {
    this.root.append(this.name, this.bar, this.ticks);
    this.root.hidden = true;
  }

  /** A scale from 0 to a length [m]. */
  show(name: string, map: ColourMap, high: number): void {
    this.root.hidden = false;
    this.name.textContent = `${name} [mm]`;
    this.bar.style.background = gradient(map, "to right");
    const marks = [0, 0.25, 0.5, 0.75, 1].map((share) => element("span", {}, share ? digits(1000 * share * high, 2) : "0"));
    this.ticks.replaceChildren(...marks);
  }

  hide(): void {
    this.root.hidden = true;
  }
}
