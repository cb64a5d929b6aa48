// What the stepper says first: the organ at rest, its laws, and what stands around it.
import type { Surface } from "../stage/body";
import type { Around } from "../stage/surroundings";
import type { Vec3 } from "../model/evaluator";
import type { Link } from "./link";

/** What the stepper says first (live/src/stage.rs, python/viscera/viewer/stepped.py). */
export interface Hello extends Partial<Around> {
  name: string;
  laws: string[];
  law: string;
  diagonal: number;
  radius: number;
  /** Null where none can be chosen. */
  gravity: Vec3 | null;
  /** Kinds of loads of the case that are not applied. */
  left_out?: string[];
  /** The graphics processor that steps it, if one does. */
  device?: string | null;
  /** What the page's address asks for of it in vain. */
  refusal?: string | null;
  /** Whether it is a solved state, which no hand can move. */
  is_still?: boolean;
  /** False where it has no stress to colour by. */
  has_stress?: boolean;
  /** World axes of the scan that the organ comes from, "RAS" or "LPS"; else empty. */
  axes?: string;
  /** By which gravity pulls, as the case names none [kg/m^3]. */
  assumed_density?: number | null;
  rest: number[];
  triangles: number[];
  /** Where it may be touched; everywhere if it is not said. */
  touchable?: number[];
  /** Of a scene, the names of its organs, and the number of each node's. */
  organs?: string[];
  organ_of?: number[];
}

/** What the stepper says first; rejects with the sentence where it refuses. */
export function introduction(link: Link): Promise<Hello> {
  return new Promise((resolve, reject) => {
    link.onClose = (sentence) => reject(new Error(sentence));
    link.onMessage = (data) => {
      // A frame is of what another view has asked for.
      if (typeof data !== "string") return;
      const hello = JSON.parse(data) as Hello | { error: string };
      if ("error" in hello) reject(new Error(hello.error));
      else resolve(hello);
    };
  });
}

/** What stands below the title: the size of the organ, what steps it, and what of its case it is without. */
export function factsOf({ rest, is_still, device, refusal, left_out, gravity, assumed_density }: Hello, place: string): string[] {
  const stepped = device ? `stepped ${place} on ${device}` : `stepped ${place}`;
  const said = [`${rest.length / 3} surface nodes`, is_still ? "a solved state" : stepped];
  if (refusal) said.push(refusal);
  if (left_out?.length) said.push(`loads of the case are not applied: ${left_out.join(", ")}`);
  if (gravity && assumed_density) said.push(`density ${assumed_density} kg/m³, as the case names none`);
  return said;
}

/** The surface that is shown and touched. */
export function surfaceOf({ rest, triangles, touchable, diagonal, organ_of, bodies = [], springs = 0 }: Hello): Surface {
  return {
    rest: Float32Array.from(rest),
    triangles: Uint32Array.from(triangles),
    touchable: Uint32Array.from(touchable ?? triangles),
    diagonal,
    organOf: organ_of,
    around: { bodies, springs },
  };
}
