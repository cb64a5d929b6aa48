// What the colours mean: a gradient with round ticks, and a mark where what is shown goes beyond it.
import { css, gradient, type ColourMap } from "../stage/colour";
import { digits, element, write } from "../base/dom";
import { scale } from "../base/scale";

/** What a scale's numbers are written in: its sign, and how many of it are one in SI units. */
export interface Unit {
  sign: string;
  each: number;
}

export const MILLIMETRES: Unit = { sign: "mm", each: 1e3 };
export const PERCENT: Unit = { sign: "%", each: 100 };
export const KILOPASCALS: Unit = { sign: "kPa", each: 1e-3 };

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
   * Shows a scale from 0, or from as much below it, to a round number at or above a value, and returns that number. The
   * field that it is for reaches to a largest value; where that is beyond the scale, the scale's end says so.
   */
  show(name: string, map: ColourMap, { sign, each }: Unit, value: number, largest: number, isSigned = false): number {
    const up = scale(each * value, isSigned ? SIGNED_STEPS : STEPS);
    const high = up.at(-1)!.value / each;
    // What a field in single precision gains by rounding is not beyond.
    const isBeyond = largest > high * (1 + 1e-5);
    this.root.hidden = false;
    write(this.name, `${name} [${sign}]`);
    this.root.classList.toggle("is-beyond", isBeyond);
    write(this.beyond, isBeyond ? `up to ${digits(each * largest, 3)}` : "");
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
    this.root.style.setProperty("--end", css(map.at(-1)!));
    const place = (value: number) => `left:${(100 * (value - low)) / (high - low)}%`;
    this.ticks.replaceChildren(...ticks.map(({ value, text }) => element("span", { style: place(value) }, text)));
  }
}

function negative({ value, text }: { value: number; text: string }): { value: number; text: string } {
  return { value: -value, text: `−${text}` };
}
