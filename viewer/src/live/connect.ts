// The view of a case, once its stepper has introduced it.
import { introduction, type Hello } from "./hello";
import type { Link } from "./link";
import { LiveView } from "./live";

/** Fills the place with the view; rejects with a sentence, and closes the link, where there can be none. */
export async function connect(place: HTMLElement, link: Link, isEmbedded: boolean, known: Partial<Hello> = {}): Promise<LiveView> {
  try {
    return new LiveView(place, link, { ...(await introduction(link)), ...known }, isEmbedded);
  } catch (error) {
    link.close();
    throw error;
  }
}
