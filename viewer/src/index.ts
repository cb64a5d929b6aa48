// What the page and the notebook load: `open` for a page, the default export for anywidget.
import { element } from "./dom";
import { connect, type LiveView } from "./live";
import { View } from "./view";

export { Evaluator } from "./evaluator";
export { View } from "./view";

declare global {
  interface Window {
    /** The view of this page, for the console and for tests. */
    viscera?: View | LiveView;
  }
}

/** Fetches a model file and fills the place with its view. */
export async function open(place: HTMLElement, url: string): Promise<void> {
  const status = element("p", { role: "status" }, "Loading the organ …");
  status.style.cssText = "position:fixed;inset:0;display:grid;place-content:center;margin:0;padding:2rem;font:16px system-ui;color:#808895";
  place.append(status);
  try {
    const response = await fetch(url);
    if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
    const view = await View.mount(place, await bytes(response, (share) => (status.textContent = `Loading the organ … ${share} %`)));
    window.viscera = view;
    view.focus();
    document.title = `${view.title} · Viscera`;
    status.remove();
  } catch (error) {
    status.textContent = `The organ cannot be shown: ${error instanceof Error ? error.message : String(error)}`;
    throw error;
  }
}

/** Connects to the stepper of a case and fills the place with its view. */
export async function openLive(place: HTMLElement, url: string): Promise<void> {
  try {
    const view = await connect(place, url);
    window.viscera = view;
    document.title = `${view.title} · Viscera`;
  } catch (error) {
    place.append(element("p", { role: "status" }, `The organ cannot be shown: ${String(error)}`));
    throw error;
  }
}

/** The body of a response, saying how much of it is there. */
async function bytes(response: Response, progress: (percent: number) => void): Promise<Uint8Array> {
  const total = Number(response.headers.get("content-length"));
  const reader = response.body?.getReader();
  if (!reader || !total) return new Uint8Array(await response.arrayBuffer());
  const chunks: Uint8Array[] = [];
  let length = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    chunks.push(part.value);
    length += part.value.length;
    progress(Math.min(100, Math.round((100 * length) / total)));
  }
  const all = new Uint8Array(length);
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
    const view = await View.mount(place, new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    return () => view.dispose();
  },
};
