// The separated form made visible: a spatial mode F_i as a movement, its function G_i over the load positions as colour.
import type { Body } from "../stage/body";
import { DIVERGING } from "../stage/colour";
import { button, choice, element } from "../base/dom";
import type { Evaluator, Vec3 } from "../model/evaluator";
import { Legend, MILLIMETRES } from "./legend";

/** Largest displacement of a mode on the stage, as a part of the organ's diagonal. */
const SIZE = 0.07;

const CAPTION = "The movement shows the mode F. The colour shows its weight G at the load positions of this region.";

export class Modes {
  readonly root: HTMLElement;
  private region = 0;
  private index = 0;
  private term = 0;
  private phase = 0;
  private field: Float32Array;
  private readonly number = element("span", { class: "mode-number" });
  private readonly caption = element("p", { class: "mode-caption" }, CAPTION);
  private readonly legend = new Legend();
  private readonly regions: HTMLSelectElement;
  private readonly slider = element("input", { type: "range", min: "0", step: "1", "aria-label": "mode" });
  /** Whether the movement swings; without it the mode stands still at its largest. */
  isSwinging = !matchMedia("(prefers-reduced-motion: reduce)").matches;

  constructor(
    private readonly evaluator: Evaluator,
    private readonly body: Body,
    towards: Vec3,
    private readonly repaint: () => void,
  ) {
    const { n_regions, n_terms, metadata } = evaluator.about;
    const regions = Array.from({ length: n_regions }, (_, r) => [String(r), `region ${r + 1}`] as [string, string]);
    const terms = monomials(metadata.order).slice(0, n_terms).map((name, t) => [String(t), name] as [string, string]);
    this.slider.addEventListener("input", () => this.select(this.region, Number(this.slider.value)));
    this.regions = choice("region", regions, (r) => this.select(Number(r), 0));
    this.regions.value = String(foremostRegion(evaluator, towards));
    this.root = element(
      "section",
      { class: "panel modes", "aria-label": "modes" },
      element("div", { class: "row" }, this.number, this.regions),
      element(
        "div",
        { class: "row" },
        button("‹", "previous mode", () => this.step(-1)),
        this.slider,
        button("›", "next mode", () => this.step(1)),
      ),
      element("label", { class: "row" }, "G in the term", choice("", terms, (t) => this.selectTerm(Number(t)))),
      this.caption,
      this.legend.root,
    );
    this.root.hidden = true;
    this.field = new Float32Array(evaluator.rest.length);
  }

  show(): void {
    this.root.hidden = false;
    this.select(Number(this.regions.value), this.index);
  }

  hide(): void {
    this.root.hidden = true;
  }

  step(by: number): void {
    this.select(this.region, this.index + by);
  }

  /** Moves the organ on by some seconds, and returns by how much [m]. */
  advance(seconds: number): Float32Array {
    this.phase = this.isSwinging ? this.phase + seconds * 2.4 : Math.PI / 2;
    const scale = SIZE * this.evaluator.about.metadata.diagonal * Math.sin(this.phase);
    const moved = this.field.map((x) => scale * x);
    this.body.move(moved);
    return moved;
  }

  select(region: number, index: number): void {
    const { regionStart } = this.evaluator;
    const start = regionStart[region]!;
    const count = regionStart[region + 1]! - start;
    this.region = region;
    this.index = Math.min(Math.max(index, 0), Math.max(count - 1, 0));
    this.slider.max = String(Math.max(count - 1, 0));
    this.slider.value = String(this.index);
    this.slider.setAttribute("aria-valuetext", `F${this.index + 1} of ${count}`);
    this.number.replaceChildren("F", element("sub", {}, String(this.index + 1)), ` of ${count}`);
    this.field = this.evaluator.mode(start + this.index).slice();
    this.paint();
  }

  private selectTerm(term: number): void {
    this.term = term;
    this.paint();
  }

  private paint(): void {
    const { positions, positionRegion, regionStart, about } = this.evaluator;
    const amplitude = this.evaluator.modeAmplitude(regionStart[this.region]! + this.index, this.term);
    const values = new Float32Array(about.n_surface).fill(NaN);
    let largest = 0;
    positions.forEach((row, p) => {
      if (positionRegion[p] !== this.region) return;
      values[row] = amplitude[p]!;
      largest = Math.max(largest, Math.abs(amplitude[p]!));
    });
    const high = this.legend.show("G at full depth", DIVERGING, MILLIMETRES, largest, largest, true);
    this.body.paint(values, -high, high, DIVERGING);
    this.repaint();
  }
}

/** The region of the load position that lies farthest towards the viewer. */
function foremostRegion(evaluator: Evaluator, towards: Vec3): number {
  const { positions, positionRegion, rest } = evaluator;
  const height = (row: number) => towards.reduce((sum, t, i) => sum + t * rest[3 * row + i]!, 0);
  const best = positions.reduce((best, row, p) => (height(row) > height(positions[best]!) ? p : best), 0);
  return positionRegion[best]!;
}

const POWERS = ["", "", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸"];

/** Names of the series' terms in the order of the model file. */
export function monomials(order: number): string[] {
  const names: string[] = [];
  for (let degree = 1; degree <= order; degree++) {
    for (let i = degree; i >= 0; i--) {
      for (let j = degree - i; j >= 0; j--) {
        const exponents = [i, j, degree - i - j];
        names.push(exponents.map((e, axis) => (e ? `d${"xyz"[axis]}${POWERS[e]}` : "")).join(""));
      }
    }
  }
  return names;
}
