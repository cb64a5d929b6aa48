// What the page and the notebook load: `open` for a page, the default export for anywidget.
import { load } from "./files";
import { SocketLink, WorkerLink, type Link } from "./link";
import { connect, type LiveView } from "./live";
import { inWords, Notice } from "./notice";
import { View } from "./view";
import { render } from "./widget";

export { Evaluator } from "./evaluator";
export { scale } from "./scale";
export { View } from "./view";

declare global {
  interface Window {
    /** The view of this page, for the console and for tests. */
    viscera?: View | LiveView;
  }
}

/** Fetches a model file and fills the place with its view. */
export async function open(place: HTMLElement, url: string): Promise<void> {
  await show(place, async (say) => View.mount(place, await load(url, loading(say)), isFramed()));
}

/** Connects to the stepper of a case on this machine and fills the place with its view. */
export async function openLive(place: HTMLElement, url: string): Promise<void> {
  await show(place, () => linked(place, new SocketLink(url)));
}

/** Fetches a case, which a worker of this page steps, and fills the place with its view. */
export async function openCase(place: HTMLElement, url: string): Promise<void> {
  await show(place, async (say) => linked(place, new WorkerLink((await load(url, loading(say))).buffer)));
}

/** Whether the page is a part of another one, which wants the wheel for itself. */
function isFramed(): boolean {
  return window !== window.top;
}

/** Fills the page with a view, or with the sentence that says why not. */
async function show(place: HTMLElement, make: (say: (words: string) => void) => Promise<View | LiveView>): Promise<void> {
  const notice = new Notice(place, "Loading the organ …");
  try {
    const view = await make((words) => notice.say(words));
    window.viscera = view;
    if (!isFramed()) view.focus();
    document.title = `${view.title} · Viscera`;
    notice.remove();
  } catch (error) {
    notice.say(inWords(error));
    throw error;
  }
}

function loading(say: (words: string) => void): (percent: number) => void {
  return (percent) => say(`Loading the organ … ${percent} %`);
}

async function linked(place: HTMLElement, link: Link): Promise<LiveView> {
  try {
    return await connect(place, link, isFramed());
  } catch (error) {
    link.close();
    throw error;
  }
}

export default { render };

// A page of one file names here what it opens.
const { opens, part } = document.querySelector<HTMLElement>("script[data-opens]")?.dataset ?? {};
if (part) void (opens === "openCase" ? openCase : open)(document.body, part);
