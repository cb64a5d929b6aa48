// The view below a notebook's cell: it follows the touches that Python asks for, and tells Python of those of a hand.
import { element } from "./base/dom";
import { KernelLink, type Kernel } from "./live/link";
import { connect } from "./live/connect";
import type { LiveView } from "./live/live";
import { inWords, Notice } from "./panels/notice";
import { agree, UNTOUCHED, type Told } from "./touch/told";
import { View } from "./view/view";

/** What Python asks for, and its own answer; the number makes the same touch anew another one. */
type Asked = Partial<Told> & { number: number };

/** The part of anywidget's model that is used. */
export interface WidgetModel extends Kernel {
  get(name: "model"): DataView;
  get(name: "height"): number;
  get(name: "asked"): Asked | undefined;
  get(name: "picture"): string;
  get(name: keyof Told): unknown;
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

/** Follows what Python asks for, and tells it what the view shows where that is something else; returns what ends that. */
function converse(view: View | LiveView, model: WidgetModel): () => void {
  let known: Told = UNTOUCHED;
  let isWaiting = false;
  const tell = () => {
    isWaiting = false;
    const { told } = view;
    if (!told || agree(told, known, view.depth)) return;
    known = told;
    for (const name of NAMES) model.set?.(name, told[name]);
    model.save_changes?.();
  };
  view.onTouch = () => {
    if (!isWaiting) requestAnimationFrame(tell);
    isWaiting = true;
  };
  const follow = ({ point = null, displacement = null, force = null, is_trusted = null }: Partial<Told>) => {
    known = { point, displacement, force, is_trusted };
    if (!point || !displacement) return view.rest();
    // A model answers in the page; a stepper that Python steps is held already.
    if (view instanceof View) view.touch(point, displacement);
    else view.watch(point, displacement);
  };
  const listener = () => follow(model.get("asked") ?? {});
  model.on?.("change:asked", listener);
  // A view that is shown anew shows the touch of now, which Python or a hand made.
  const present = Object.fromEntries(NAMES.map((name) => [name, model.get(name)])) as Partial<Told>;
  if (present.point) follow(present);
  return () => model.off?.("change:asked", listener);
}
