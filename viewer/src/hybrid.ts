// The hybrid start: the organ of a model is stepped until the model has arrived, which then takes over.
import { Evaluator } from "./model/evaluator";
import { load } from "./model/files";
import { WorkerLink } from "./live/link";
import { connect } from "./live/connect";
import type { LiveView } from "./live/live";
import { indices, notesOf } from "./model/safetensors";
import { sentenceOf } from "./panels/notice";
import { View } from "./view/view";

/** The view of the organ that is stepped first, and the model's view once that has taken over. */
export interface Hybrid {
  first: LiveView;
  /** Rejects where the model cannot be loaded; the organ is stepped on then. */
  then: Promise<View>;
}

/** Steps a case in a place and loads the model behind it. */
export async function hybrid(place: HTMLElement, caseUrl: string, modelUrl: string, isEmbedded: boolean): Promise<Hybrid> {
  const bytes = await load(caseUrl, () => {});
  // The model's own surface is touched, and nothing pulls at the organ.
  const known = { touchable: Array.from(indices(bytes, "touchable")), gravity: null, ...notesOf(bytes) };
  const first = await connect(place, new WorkerLink(bytes.buffer), isEmbedded, known);
  return { first, then: takeOver(place, first, [caseUrl, modelUrl], isEmbedded) };
}

/** Puts the model's view in the place of the first one, once no hand holds on. */
async function takeOver(
  place: HTMLElement,
  first: LiveView,
  [caseUrl, modelUrl]: readonly [string, string],
  isEmbedded: boolean,
): Promise<View> {
  try {
    first.say("loading the reduced model");
    const model = await load(modelUrl, (percent) => first.say(`loading the reduced model, ${percent} %`));
    const evaluator = await Evaluator.load(model);
    first.say("the reduced model takes over when you let go");
    await first.free();
    const view = new View(place, evaluator, isEmbedded, caseUrl);
    view.stage.lookFrom(first.from);
    view.announce("The reduced model has taken over.");
    first.dispose();
    return view;
  } catch (error) {
    first.say(`the reduced model could not be loaded: ${sentenceOf(error)}`);
    throw error;
  }
}
