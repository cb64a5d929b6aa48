// What the colour of stepped organs means: nothing, displacement or stress, all of them to one scale with its legend.
import { PLASMA, VIRIDIS } from "../stage/colour";
import type { Hello } from "./hello";
import { KILOPASCALS, MILLIMETRES, type Legend } from "../panels/legend";
import type { Specimen } from "./specimen";

const LIVE_COLOURINGS = ["tissue", "displacement", "stress"] as const;
export type LiveColouring = (typeof LIVE_COLOURINGS)[number];

/** Those of what is stepped: tissue that relaxes has no stress in a frame. */
export function colouringsOf({ has_stress = true }: Hello): readonly LiveColouring[] {
  return LIVE_COLOURINGS.filter((colouring) => has_stress || colouring !== "stress");
}

/** Nodes above the scale of the stress, as a part of all: the peaks at a patch's rim would take the whole scale. */
const PEAKS = 0.02;

export class LivePainter {
  colouring: LiveColouring = "tissue";
  /** The largest stress since a hand took hold, its peaks left out [Pa]: the scale never shrinks under a hand. */
  private stressed = 0;

  constructor(
    private readonly legend: Legend,
    /** The scale of displacements reaches to this [m]. */
    private readonly depth: number,
    /** Those that there are to choose from. */
    private readonly known: readonly LiveColouring[],
  ) {}

  get next(): LiveColouring {
    return this.known[(this.known.indexOf(this.colouring) + 1) % this.known.length]!;
  }

  /** A hand takes hold anew: the scale of the stress is that of what it does. */
  begin(): void {
    this.stressed = 0;
  }

  show(specimens: readonly Specimen[]): void {
    switch (this.colouring) {
      case "tissue":
        specimens.forEach(({ body }) => body.paintTissue());
        return this.legend.hide();
      case "displacement": {
        const values = specimens.map((specimen) => specimen.distances());
        const high = this.legend.show("displacement", VIRIDIS, MILLIMETRES, this.depth, largest(values));
        return specimens.forEach(({ body }, k) => body.paint(values[k]!, 0, high, VIRIDIS));
      }
      case "stress": {
        const values = specimens.map(({ stress }) => stress);
        // The first frame with the stress is under way.
        if (values.some(({ length }) => length === 0)) return;
        this.stressed = Math.max(this.stressed, ...values.map(withoutPeaks));
        const high = this.legend.show("von Mises stress", PLASMA, KILOPASCALS, this.stressed || 1, largest(values));
        return specimens.forEach(({ body }, k) => body.paint(values[k]!, 0, high, PLASMA));
      }
    }
  }
}

function largest(values: readonly Float32Array[]): number {
  return values.reduce((most, of) => of.reduce((most, x) => Math.max(most, x), most), 0);
}

/** The largest value, but for the few nodes that stand out. */
function withoutPeaks(values: Float32Array): number {
  return values.slice().sort()[Math.floor((1 - PEAKS) * (values.length - 1))] ?? 0;
}
