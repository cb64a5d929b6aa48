// The controls of a case that is stepped: its name above, tools below, and the help.
import { tissueOf } from "../stage/body";
import { css } from "../stage/colour";
import type { Hello } from "./hello";
import { button, choice, element, helpDialog, Segments, write } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { LIVE_KEYS, STILL_KEYS } from "../hands/keys";
import type { LiveView } from "./live";
import { endsOf, NAMES } from "../panels/gauge";
import { colouringsOf, type LiveColouring } from "./colouring";
import type { Tool } from "../hands/pointer";

const NONE = "0,0,0";
const GRAVITIES: readonly [string, string][] = [
  [NONE, "no gravity"],
  ["0,0,-9.81", "gravity −z"],
  ["0,0,9.81", "gravity +z"],
  ["0,-9.81,0", "gravity −y"],
  ["0,9.81,0", "gravity +y"],
  ["-9.81,0,0", "gravity −x"],
  ["9.81,0,0", "gravity +x"],
];

const COLOURINGS: Record<LiveColouring, [LiveColouring, string, string]> = {
  tissue: ["tissue", "Tissue", "the colour of tissue"],
  displacement: ["displacement", "Displacement", "colour by displacement"],
  stress: ["stress", "Stress", "colour by the von Mises stress"],
};

/** The choice, with the gravity of the case where that is another one; by the directions of a patient where they are known. */
function gravities({ gravity, axes = "" }: Hello): readonly [string, string][] {
  const value = gravity?.join() ?? NONE;
  const ends = endsOf(axes);
  const known = GRAVITIES.map(([each, words]): [string, string] => {
    const along = each.split(",").findIndex((part) => Number(part) !== 0);
    const end = ends?.[along]?.[each.includes("-") ? 1 : 0];
    return [each, end ? `gravity to ${end}, ${NAMES[end]}` : words];
  });
  return known.some(([each]) => each === value) ? known : [[value, "gravity of the case"], ...known];
}

export class LiveTools {
  readonly header: HTMLElement;
  readonly root: HTMLElement;
  readonly help: HTMLDialogElement;
  readonly tool: Segments<Tool>;
  readonly colouring: Segments<LiveColouring>;
  private readonly news = element("span");
  private readonly about: HTMLElement;
  private readonly outline: HTMLButtonElement;
  private readonly probe: HTMLButtonElement;

  /** Above stand the organs of a scene, each with its colour, and the facts. */
  constructor(view: LiveView, hello: Hello, facts: readonly string[], headset: HTMLButtonElement) {
    const { organs = [], gravity, is_still } = hello;
    this.help = is_still ? helpDialog("Look at the organ", STILL_KEYS) : helpDialog("Take hold of the organ", LIVE_KEYS);
    const theme = button("◐", "light or dark theme", () => view.toggleTheme(), "T");
    const help = button("?", "keys and gestures", () => this.help.showModal(), "?");
    const corner = element("div", { class: "corner" }, headset, view.share.root, theme, help);
    const names = organs.map((name, k) => element("span", { class: "organ", style: `--tissue: ${css(tissueOf(k))}` }, name));
    const named = names.flatMap((name, k) => [name, k + 1 < names.length ? ", " : "; "]);
    this.about = element("p", { title: facts.join(" · ") }, ...named, facts.join(" · "), this.news);
    this.header = element("header", {}, element("h1", {}, view.title), this.about, corner);
    this.tool = new Segments<Tool>(
      "tool",
      [
        ["push", "Push", "press on the organ, move down to push in and up to pull out"],
        ["drag", "Drag", "press on the organ and drag it in the plane of the screen"],
      ],
      (tool) => view.setTool(tool),
    );
    this.tool.value = view.tool;
    const colourings = colouringsOf(hello).map((name) => COLOURINGS[name]);
    this.colouring = new Segments<LiveColouring>("colour", colourings, (colouring) => view.setColouring(colouring));
    this.colouring.value = "tissue";
    this.outline = button("Wireframe", "show the shape at rest as a wireframe", () => view.toggleOutline(), "W");
    this.probe = button("Probe", "show probes in place of the forces' arrows", () => view.toggleProbe(), "F");
    this.hasProbe = this.hasOutline = false;
    const pull = choice("gravity", gravities(hello), (value) => view.setGravity(value.split(",").map(Number) as Vec3));
    pull.value = gravity?.join() ?? NONE;
    pull.hidden = gravity === null;
    const reset = button("Reset", is_still ? "reset the view" : "start again from rest", () => view.reset(), "R");
    // Nobody can take hold of a solved state.
    this.tool.root.hidden = this.probe.hidden = is_still ?? false;
    const { choice: look, slider } = view.sight;
    const controls = [this.tool.root, pull, this.colouring.root, this.outline, this.probe, look.root, slider, reset];
    this.root = element("nav", { class: "panel tools", "aria-label": "tools" }, ...controls);
  }

  /** Says what is under way. */
  say(words: string): void {
    write(this.news, ` · ${words}`);
    this.about.title = this.about.textContent ?? "";
  }

  get hasProbe(): boolean {
    return this.probe.getAttribute("aria-pressed") === "true";
  }

  set hasProbe(isOn: boolean) {
    this.probe.setAttribute("aria-pressed", String(isOn));
  }

  get hasOutline(): boolean {
    return this.outline.getAttribute("aria-pressed") === "true";
  }

  set hasOutline(isOn: boolean) {
    this.outline.setAttribute("aria-pressed", String(isOn));
  }
}
