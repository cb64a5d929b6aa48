// The controls: name of the organ above, tools below, and the help.
import type { Colouring } from "./colouring";
import { button, digits, element, helpDialog, millimetres, percent, Segments } from "../base/dom";
import type { Notes } from "../model/evaluator";
import { KEYS } from "../hands/keys";
import { lawName } from "../model/lawname";
import type { Tool } from "../hands/pointer";
import type { View } from "./view";

type Switch = "keep" | "outline" | "probe" | "path" | "modes";

export class Tools {
  readonly header: HTMLElement;
  readonly root: HTMLElement;
  readonly help: HTMLDialogElement;
  readonly tool: Segments<Tool>;
  readonly colouring: Segments<Colouring>;
  private readonly stiffness = element("input", {
    type: "range",
    min: "-2",
    max: "2",
    step: "0.1",
    value: "0",
    "aria-label": "stiffness",
    title: "multiply all stiffnesses of the organ by a factor: the shape stays the same, the force changes",
  });
  private readonly about: HTMLElement;
  private readonly factor = element("span", {}, "× 1");
  private readonly switches: Record<Switch, HTMLButtonElement>;

  constructor(view: View, headset: HTMLButtonElement) {
    const { about } = view.evaluator;
    const { metadata } = about;
    const { web, parameter } = view.evaluator.notes;
    const facts = [
      "reduced model",
      lawName(metadata.law),
      `${view.evaluator.outer.length} surface nodes`,
      ...(parameter ? [setting(parameter)] : []),
      `up to ${millimetres(metadata.depth)} deep`,
      ...(web ? [`web version, within ${percent(web.worst_error)} of the full model in ${web.touches} touches`] : []),
    ];
    this.about = element("p", { title: facts.join(" · ") }, facts.join(" · "));
    this.header = element(
      "header",
      {},
      element("h1", {}, view.title),
      this.about,
      element(
        "div",
        { class: "corner" },
        headset,
        view.share.root,
        button("◐", "light or dark theme", () => view.toggleTheme(), "T"),
        button("?", "keys and gestures", () => this.help.showModal(), "?"),
      ),
    );
    this.tool = new Segments<Tool>(
      "tool",
      [
        ["push", "Push", "press on the organ, move down to push in and up to pull out"],
        ["drag", "Drag", "press on the organ and drag it in the plane of the screen"],
      ],
      (tool) => view.setTool(tool),
    );
    this.tool.value = "push";
    this.colouring = new Segments<Colouring>(
      "colour",
      [
        ["tissue", "Tissue", "the colour of tissue"],
        ["displacement", "Displacement", "colour by displacement"],
        ["strain", "Strain", "colour by the surface strain: the largest change of length in any direction along the surface"],
        ["error", "Error", "colour by the estimated error or, at a lower order, by the difference from the highest"],
      ],
      (colouring) => view.setColouring(colouring),
    );
    this.switches = {
      keep: button("Keep", "keep the touch after release", () => view.toggleKeeping(), "K"),
      outline: button("Wireframe", "show the shape at rest as a wireframe", () => view.toggleOutline(), "W"),
      probe: button("Probe", "press with a round probe that slides over the surface", () => view.toggleProbe(), "F"),
      path: button("▶ Path", "move a contact along a path over the surface", () => view.togglePath(), "P"),
      modes: button("Modes", "show the modes of the reduced model", () => view.toggleModes(), "M"),
    };
    this.root = element(
      "nav",
      { class: "panel tools", "aria-label": "tools" },
      this.tool.root,
      this.switches.keep,
      this.switches.outline,
      this.switches.probe,
      this.switches.path,
      this.colouring.root,
      this.switches.modes,
      view.sight.choice.root,
      view.sight.slider,
      ...(view.evaluator.notes.is_stress_free ? [element("label", { class: "stiffness" }, "Stiffness", this.stiffness, this.factor)] : []),
      button("Reset", "let go and reset the view", () => view.reset(), "R"),
    );
    this.stiffness.addEventListener("input", () => view.setStiffness(2 ** Number(this.stiffness.value)));
    (Object.keys(this.switches) as Switch[]).forEach((name) => this.press(name, false));
    this.help = helpDialog("Touch the organ", KEYS);
    this.sayStiffness(view.evaluator.factor);
  }

  /** Adds to the line under the title. */
  say(words: string): void {
    this.about.append(` · ${words}`);
    this.about.title = this.about.textContent ?? "";
  }

  sayStiffness(factor: number): void {
    this.stiffness.value = String(Math.log2(factor));
    this.factor.textContent = `× ${digits(factor, 2)}`;
    // The slider itself stands at the factor's logarithm.
    this.stiffness.setAttribute("aria-valuetext", `${digits(factor, 2)} times`);
    this.factor.parentElement?.classList.toggle("is-changed", factor !== 1);
  }

  press(name: Switch, isOn: boolean): void {
    this.switches[name].setAttribute("aria-pressed", String(isOn));
  }
}

/** The value of the parameter that the page answers for, and the range that the model has of it. */
function setting({ name, unit, value, range }: NonNullable<Notes["parameter"]>): string {
  const [scale, shown] = unit === "Pa" ? [1e-3, "kPa"] : unit === "m" ? [1e3, "mm"] : [1, unit];
  const [at, low, high] = [value, ...range].map((x) => String(Number((scale * x).toPrecision(3)))) as [string, string, string];
  return `${name} ${at} of ${low} to ${high} ${shown}`.trim();
}
