// The view below a notebook's cell: it follows the touches that Python asks for, and tells Python of those of a hand.
import { element } from "./dom";
import type { Vec3 } from "./evaluator";
import { KernelLink, type Kernel } from "./link";
import { connect, type LiveView } from "./live";
import { inWords, Notice } from "./notice";
import type { Told } from "./touchstate";
import { View } from "./view";

/** What Python asks for; the number makes the same touch anew another one. */
interface Asked {
  number: number;
  point?: Vec3;
  displacement?: Vec3;
}

/** The part of anywidget's model that is used. */
export interface WidgetModel extends Kernel {
  get(name: "model"): DataView;
  get(name: "height"): number;
  get(name: "asked"): Asked | undefined;
  get(name: "picture"): string;
  set?(name: keyof Told, value: unknown): void;
  save_changes?(): void;
}

const NAMES: readonly (keyof Told)[] = ["point", "displacement", "force", "is_trusted"];

/** Fills a cell's output with the view of a model; returns what removes it. */
export async function render({ model, el }: { model: WidgetModel; el: HTMLElement }): Promise<() => void> {
  const place = element("div");
  place.style.cssText = `position:relative;height:${model.get("height")}px;border-radius:10px;overflow:hidden`;
  el.append(place);
  const picture = hidePicture(model.get("picture"));
  try {
    const view = await mount(place, model);
    const deaf = converse(view, model);
    return () => {
      deaf();
      view.dispose();
      picture.remove();
    };
  } catch (error) {
    const notice = new Notice(place, inWords(error));
    return () => {
      notice.remove();
      picture.remove();
    };
  }
}

/** A reduced model, which the page evaluates; or, where there is none, what the kernel steps. */
async function mount(place: HTMLElement, model: WidgetModel): Promise<View | LiveView> {
  const data = model.get("model");
  if (data.byteLength === 0) return connect(place, new KernelLink(model), true);
  return View.mount(place, new Uint8Array(data.buffer, data.byteOffset, data.byteLength), true);
}

/** The picture that stays in a saved notebook is not needed beside the view. */
function hidePicture(name: string | undefined): HTMLStyleElement {
  const style = element("style", {}, name ? `img[data-viscera="${name}"] { display: none }` : "");
  document.head.append(style);
  return style;
}

function converse(view: View | LiveView, model: WidgetModel): () => void {
  let [isFollowing, isWaiting, last] = [false, false, ""];
  const tell = () => {
    isWaiting = false;
    const { told } = view;
    const text = JSON.stringify(told);
    if (text === last) return;
    last = text;
    for (const name of NAMES) model.set?.(name, told[name]);
    model.save_changes?.();
  };
  view.onTouch = () => {
    // What Python asked for it knows already.
    if (isFollowing) last = JSON.stringify(view.told);
    else if (!isWaiting) requestAnimationFrame(tell);
    isWaiting ||= !isFollowing;
  };
  const follow = () => {
    const asked = model.get("asked");
    if (!asked?.number) return;
    isFollowing = true;
    if (asked.point && asked.displacement) view.touch(asked.point, asked.displacement);
    else view.rest();
    isFollowing = false;
  };
  model.on?.("change:asked", follow);
  follow();
  return () => model.off?.("change:asked", follow);
}
