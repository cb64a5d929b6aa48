// What the page and the notebook load: `open` for a page, the default export for anywidget.
import { load } from "./model/files";
import { hybrid } from "./hybrid";
import { SocketLink, WorkerLink } from "./live/link";
import { connect } from "./live/connect";
import type { LiveView } from "./live/live";
import { notesOf } from "./model/safetensors";
import { inWords, Notice, sentenceOf } from "./panels/notice";
import { View } from "./view/view";
import { render } from "./widget";

export { Evaluator } from "./model/evaluator";
export { scale } from "./base/scale";
export { View } from "./view/view";

declare global {
  interface Window {
    /** The view of this page, for the console and for tests. */
    viscera?: View | LiveView;
  }
}

/** Fetches a model file and fills the place with its view; a case of the same organ, if there is one, answers two hands. */
export async function open(place: HTMLElement, url: string, caseUrl: string | null = null): Promise<void> {
  await show(place, async (say) => View.mount(place, await load(url, loading(say)), isFramed(), caseUrl));
}

/** Connects to the stepper of a case on this machine and fills the place with its view. */
export async function openLive(place: HTMLElement, url: string): Promise<void> {
  await show(place, () => connect(place, new SocketLink(url), isFramed()));
}

/** Fetches a case, which a worker of this page steps, and fills the place with its view. */
export async function openCase(place: HTMLElement, url: string): Promise<void> {
  await show(place, async (say) => {
    const bytes = await load(url, loading(say));
    const notes = notesOf(bytes);
    return connect(place, new WorkerLink(bytes.buffer), isFramed(), notes);
  });
}

/**
 * Fetches a case, which a worker of this page steps, and the model of the same organ behind it, which takes over when it
 * has arrived. An address that carries a touch is the model's own. Where the case cannot be stepped, the model comes alone.
 */
export async function openHybrid(place: HTMLElement, caseUrl: string, modelUrl: string): Promise<void> {
  if (location.hash) return open(place, modelUrl, caseUrl);
  await show(place, async (say) => {
    try {
      const { first, then } = await hybrid(place, caseUrl, modelUrl, isFramed());
      // Where the model cannot be loaded, the first view says so.
      void then.then(enter, () => {});
      return first;
    } catch (error) {
      const view = await View.mount(place, await load(modelUrl, loading(say)), isFramed());
      view.say(`the organ cannot be stepped by hands: ${sentenceOf(error)}`);
      return view;
    }
  });
}

/** Whether the page is a part of another one, which wants the wheel for itself. */
function isFramed(): boolean {
  return window !== window.top;
}

/** Fills the page with a view, or with the sentence that says why not. */
async function show(place: HTMLElement, make: (say: (words: string) => void) => Promise<View | LiveView>): Promise<void> {
  place.querySelector(":scope > .loading")?.remove();
  const notice = new Notice(place, "Loading the organ …");
  try {
    enter(await make((words) => notice.say(words)));
    notice.remove();
  } catch (error) {
    notice.say(inWords(error));
    throw error;
  }
}

/** Makes a view that of the page. */
function enter(view: View | LiveView): void {
  window.viscera = view;
  if (!isFramed()) view.focus();
  document.title = `${view.title} · Viscera`;
}

function loading(say: (words: string) => void): (percent: number) => void {
  return (percent) => say(`Loading the organ … ${percent} %`);
}

export default { render };

// A page of one file names here what it opens.
const { opens, part } = document.querySelector<HTMLElement>("script[data-opens]")?.dataset ?? {};
if (part) void (opens === "openCase" ? openCase : open)(document.body, part);
