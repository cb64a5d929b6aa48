// What the page and the notebook load: `open` for a page, the default export for anywidget.
import { element } from "./dom";
import { SocketLink, WorkerLink, type Link } from "./link";
import { connect, type LiveView } from "./live";
import { requireRoom, withinMemory } from "./memory";
import { inWords, Notice } from "./notice";
import { View } from "./view";

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
  await show(place, async (say) => View.mount(place, await load(url, say), isFramed()));
}

/** Connects to the stepper of a case on this machine and fills the place with its view. */
export async function openLive(place: HTMLElement, url: string): Promise<void> {
  await show(place, () => linked(place, new SocketLink(url)));
}

/** Fetches a case, which a worker of this page steps, and fills the place with its view. */
export async function openCase(place: HTMLElement, url: string): Promise<void> {
  await show(place, async (say) => linked(place, new WorkerLink((await load(url, say)).buffer)));
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

async function linked(place: HTMLElement, link: Link): Promise<LiveView> {
  try {
    return await connect(place, link, isFramed());
  } catch (error) {
    link.close();
    throw error;
  }
}

/** The bytes of a file, saying how much of them is there. */
async function load(url: string, say: (words: string) => void): Promise<Uint8Array<ArrayBuffer>> {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  const total = Number(response.headers.get("content-length"));
  requireRoom(total);
  const reader = response.body?.getReader();
  if (!reader || !total) return new Uint8Array(await response.arrayBuffer());
  const chunks: Uint8Array[] = [];
  let length = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    chunks.push(part.value);
    length += part.value.length;
    say(`Loading the organ … ${Math.min(100, Math.round((100 * length) / total))} %`);
  }
  const all = withinMemory(length, () => new Uint8Array(length));
  chunks.reduce((at, chunk) => (all.set(chunk, at), at + chunk.length), 0);
  return all;
}

/** The part of anywidget's model that is used. */
interface WidgetModel {
  get(name: "model"): DataView;
  get(name: "height"): number;
}

export default {
  async render({ model, el }: { model: WidgetModel; el: HTMLElement }): Promise<() => void> {
    const place = element("div");
    place.style.cssText = `position:relative;height:${model.get("height")}px;border-radius:10px;overflow:hidden`;
    el.append(place);
    const data = model.get("model");
    try {
      const view = await View.mount(place, new Uint8Array(data.buffer, data.byteOffset, data.byteLength), true);
      return () => view.dispose();
    } catch (error) {
      const notice = new Notice(place, inWords(error));
      return () => notice.remove();
    }
  },
};
