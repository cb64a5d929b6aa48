// What a frame says of the organs, in words: their forces, and what is the matter with them.
import { newtons } from "../base/dom";
import { lawName } from "../model/lawname";
import { WORTH, type Hand, type Specimen } from "./specimen";

/** Frames of hands at rest after which an organ that has not settled is not expected to. */
const PATIENCE = 60;

/** The forces of the hands that hold on, specimen by specimen; what they hold of a scene is named. Those of an organ that does
 * not settle are no numbers to be told: they change with every frame. */
export function forces(specimens: readonly Specimen[], hands: readonly (Hand | null)[], resting: number): string {
  const said = specimens.map((specimen) => {
    const { law, sizes, standing } = specimen;
    const held = hands.flatMap((hand) => hand?.organ ?? []).join(" and ") || lawName(law);
    if (isStuck(specimen, resting)) return `${held}: ${WORTH.unsettled}.`;
    const sizesHeld = sizes.filter((_, hand) => hands[hand]).map(newtons);
    const worth = standing === "sound" ? "" : `, ${WORTH[standing]}`;
    return `${held}: ${sizesHeld.join(" and ")}${worth}.`;
  });
  return said.join(" ");
}

function isStuck({ facts }: Specimen, resting: number): boolean {
  return resting > PATIENCE && !facts.isSettled;
}

/** What is the matter with the last frame; empty where nothing is, and of buckling while the organ comes to its loads. */
export function trouble(specimens: readonly Specimen[], hands: readonly (Hand | null)[], resting: number): string {
  const named = ({ law }: Specimen) => (specimens.length > 1 ? ` (${lawName(law)})` : "");
  const stuck = hands.some(Boolean) && specimens.find((specimen) => isStuck(specimen, resting));
  if (stuck) return `The organ does not come to rest here${named(stuck)}: ease the hand, or let go.`;
  const cut = hands.some(Boolean) && specimens.find(({ facts }) => facts.taken < 1);
  if (cut) return `The hand moves too fast${named(cut)}: the step was shortened, so that no cell is inverted.`;
  const flat = specimens.find(({ facts }) => facts.cellsAtBound > 0);
  if (flat) return `A cell has reached the limit of its deformation${named(flat)}.`;
  const unstable = specimens.find(({ facts, hasSettled }) => facts.isUnstable && hasSettled);
  return unstable ? `The organ is about to buckle here${named(unstable)}.` : "";
}
