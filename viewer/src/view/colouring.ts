// What the colour of a touched surface means: nothing, displacement, strain, or error, with its legend.
import type { Body } from "../stage/body";
import { INFERNO, PLASMA, VIRIDIS, type ColourMap } from "../stage/colour";
import { lengths } from "../model/field";
import { MILLIMETRES, PERCENT, type Legend, type Unit } from "../panels/legend";
import { SurfaceStrain } from "../stage/strain";

export const COLOURINGS = ["tissue", "displacement", "strain", "error"] as const;
export type Colouring = (typeof COLOURINGS)[number];

/** What is shown of one touch or more: the field of an order (s, 3) [m], and the length of its error (s,) [m], if known. */
export interface Coloured {
  readonly field: Float32Array;
  localError?(order: number, out: Float32Array): void;
  /** Whether that error includes a probe's contact, which is never known well. */
  readonly hasProbe?: boolean;
}

/** A surface: its nodes at rest (s, 3) [m], the same without the load that it may be under, triangles between their rows. */
interface Painted {
  readonly rest: Float32Array;
  readonly unloaded?: Float32Array;
  readonly triangles: Uint32Array;
}

/** The scale of strains reaches so far beyond those at rest. */
const STRAIN = 0.1;
/** That of errors reaches to this part of the depth; where a probe's contact is among them, to the depth. */
const ERROR = 0.05;

export class Painter {
  colouring: Colouring = "tissue";
  private readonly values: Float32Array;
  private strain: SurfaceStrain | null = null;
  /** The largest strain at rest, under the load that a touch is about. */
  private strained = 0;

  constructor(
    private readonly surface: Painted,
    private readonly body: Body,
    private readonly legend: Legend,
    /** What the model is made for [m], which scales reach to, and its highest order. */
    private readonly about: { depth: number; order: number },
  ) {
    this.values = new Float32Array(surface.rest.length / 3);
  }

  /** One for another surface of the same organ, to the same scales and with the same legend. */
  beside(surface: Painted, body: Body): Painter {
    return new Painter(surface, body, this.legend, this.about);
  }

  get next(): Colouring {
    return COLOURINGS[(COLOURINGS.indexOf(this.colouring) + 1) % COLOURINGS.length]!;
  }

  /** Colours the surface by a touch, in the field of an order; null is nobody touching. Without a known error it is tissue. */
  show(touching: Coloured | null, order: number): void {
    const { values } = this;
    const { depth, order: highest } = this.about;
    values.fill(0);
    switch (this.colouring) {
      case "tissue":
        return this.paintTissue();
      case "displacement":
        if (touching) lengths(touching.field, values);
        return this.paint("displacement", VIRIDIS, MILLIMETRES, depth);
      case "strain":
        this.strain ??= this.strainOfRest();
        this.strain.at(touching && touching.field, values);
        return this.paint("surface strain", PLASMA, PERCENT, this.strained + STRAIN);
      case "error":
        if (touching && !touching.localError) return this.paintTissue();
        touching?.localError?.(order, values);
        if (order < highest) return this.paint(`difference from order ${highest}`, INFERNO, MILLIMETRES, ERROR * depth);
        return this.paint("estimated error", INFERNO, MILLIMETRES, touching?.hasProbe ? depth : ERROR * depth);
    }
  }

  /** What measures strains, once it has those that are there without a touch. */
  private strainOfRest(): SurfaceStrain {
    const { surface, values } = this;
    const strain = new SurfaceStrain(surface.rest, surface.triangles, surface.unloaded);
    strain.at(null, values);
    this.strained = this.largest;
    return strain;
  }

  private paintTissue(): void {
    this.body.paintTissue();
    this.legend.hide();
  }

  /** Colours by the values, on a scale that reaches to one of them at least. */
  private paint(name: string, map: ColourMap, unit: Unit, least: number): void {
    this.body.paint(this.values, 0, this.legend.show(name, map, unit, least, this.largest), map);
  }

  private get largest(): number {
    return this.values.reduce((most, x) => Math.max(most, x), 0);
  }
}
