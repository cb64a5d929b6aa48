// What the colours mean: a gradient with round ticks, and a mark where what is shown goes beyond it.
import { gradient, type ColourMap } from "./colour";
import { digits, element } from "./dom";
import { scale } from "./scale";

/** At most so many steps between ticks on either side of zero. */
const STEPS = 7;
const SIGNED_STEPS = 2;

export class Legend {
  readonly root = element("div", { class: "panel legend" });
  private readonly name = element("span", { class: "legend-name" });
  private readonly bar = element("div", { class: "legend-bar" });
  private readonly ticks = element("div", { class: "legend-ticks" });
  private readonly beyond = element("span", { class: "legend-beyond" });
  private drawn = "";

  constructor() {
    const head = element("div", { class: "legend-head" }, this.name, this.beyond);
    this.root.append(head, element("div", { class: "legend-scale" }, this.bar, this.ticks));
    this.root.hidden = true;
  }

  /**
   * Shows a scale from 0, or from as much below it, to a round number at or above a length [m], and returns that [m].
   * The field that it is for reaches to a largest length [m]; where that is beyond the scale, the scale's end says so.
   */
  show(name: string, map: ColourMap, length: number, largest: number, isSigned = false): number {
    const up = scale(1000 * length, isSigned ? SIGNED_STEPS : STEPS);
    const high = up.at(-1)!.value / 1000;
    // What a field in single precision gains by rounding is not beyond.
    const isBeyond = largest > high * (1 + 1e-5);
    this.root.hidden = false;
    this.name.textContent = `${name} [mm]`;
    this.root.classList.toggle("is-beyond", isBeyond);
    this.beyond.textContent = isBeyond ? `up to ${digits(1000 * largest, 3)}` : "";
    this.draw(map, isSigned ? [...up.slice(1).reverse().map(negative), ...up] : up);
    return high;
  }

  hide(): void {
    this.root.hidden = true;
  }

  private draw(map: ColourMap, ticks: ReturnType<typeof scale>): void {
    const [low, high] = [ticks[0]!.value, ticks.at(-1)!.value];
    const background = gradient(map, "to right");
    const drawn = `${background} ${low} ${high}`;
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.bar.style.background = background;
    this.root.style.setProperty("--end", `rgb(${map.at(-1)!.map((x) => Math.round(255 * x)).join(" ")})`);
    const place = (value: number) => `left:${(100 * (value - low)) / (high - low)}%`;
    this.ticks.replaceChildren(...ticks.map(({ value, text }) => element("span", { style: place(value) }, text)));
  }
}

function negative({ value, text }: { value: number; text: string }): { value: number; text: string } {
  return { value: -value, text: `−${text}` };
}
