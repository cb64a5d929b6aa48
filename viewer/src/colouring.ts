// What the colour of a touched surface means: nothing, displacement, strain, or error, with its legend.
import type { Body } from "./body";
import { INFERNO, PLASMA, VIRIDIS, type ColourMap } from "./colour";
import type { Evaluator } from "./evaluator";
import { lengths } from "./field";
import { MILLIMETRES, PERCENT, type Legend, type Unit } from "./legend";
import { SurfaceStrain } from "./strain";

export const COLOURINGS = ["tissue", "displacement", "strain", "error"] as const;
export type Colouring = (typeof COLOURINGS)[number];

/** What is shown of one touch or more: the field of an order (s, 3) [m], and the length of its error (s,) [m]. */
export interface Coloured {
  readonly field: Float32Array;
  localError(order: number, out: Float32Array): void;
}

/** The scale of strains reaches to this at least. */
const STRAIN = 0.1;

export class Painter {
  colouring: Colouring = "tissue";
  private readonly values: Float32Array;
  private strain: SurfaceStrain | null = null;

  constructor(
    private readonly evaluator: Evaluator,
    private readonly body: Body,
    private readonly legend: Legend,
  ) {
    this.values = new Float32Array(evaluator.about.n_surface);
  }

  get next(): Colouring {
    return COLOURINGS[(COLOURINGS.indexOf(this.colouring) + 1) % COLOURINGS.length]!;
  }

  /** Colours the surface by a touch, in the field of an order; null is nobody touching. */
  show(touching: Coloured | null, order: number): void {
    const { values, evaluator } = this;
    const { depth, order: highest } = evaluator.about.metadata;
    values.fill(0);
    switch (this.colouring) {
      case "tissue":
        this.body.paintTissue();
        return this.legend.hide();
      case "displacement":
        if (touching) lengths(touching.field, values);
        return this.paint("displacement", VIRIDIS, MILLIMETRES, depth);
      case "strain":
        // What a touch is about may be strained already.
        this.strain ??= new SurfaceStrain(evaluator.rest, evaluator.triangles, evaluator.unloaded);
        this.strain.at(touching && touching.field, values);
        return this.paint("surface strain", PLASMA, PERCENT, STRAIN);
      case "error":
        touching?.localError(order, values);
        return this.paint(order < highest ? `difference from order ${highest}` : "estimated error", INFERNO, MILLIMETRES, 0.05 * depth);
    }
  }

  /** Colours by the values, on a scale that reaches to one of them at least. */
  private paint(name: string, map: ColourMap, unit: Unit, least: number): void {
    const largest = this.values.reduce((most, x) => Math.max(most, x), 0);
    this.body.paint(this.values, 0, this.legend.show(name, map, unit, least, largest), map);
  }
}
