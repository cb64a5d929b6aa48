// A case in real time: every frame is asked for, from this machine or a worker; one organ, or two laws side by side.
import * as THREE from "three";
import { lookOver, type Hit, type Surface } from "./body";
import { VIRIDIS } from "./colour";
import { Contrast } from "./contrast";
import { button, choice, element, followTheme, helpDialog, newtons, Segments, toggleTheme } from "./dom";
import type { Vec3 } from "./evaluator";
import { Gauge } from "./gauge";
import { Hint } from "./hint";
import { LIVE_KEYS, listen, type Keyed } from "./keys";
import { Legend } from "./legend";
import type { Link } from "./link";
import { Mean, paceInWords } from "./pace";
import { nudged, Pointer, type Tool, type Touched } from "./pointer";
import { FACTS, Specimen, type Hand } from "./specimen";
import { Share, type Shared } from "./share";
import { Sight } from "./sight";
import { CONTEXT_LOST, Stage } from "./stage";
import style from "./style.css?inline";
import { Summary } from "./summary";
import { headsetButton } from "./xr";

/** What the stepper says first (live/src/stage.rs). */
interface Hello {
  name: string;
  laws: string[];
  law: string;
  diagonal: number;
  radius: number;
  gravity: Vec3;
  rest: number[];
  triangles: number[];
}

type Request = { laws?: string[]; grab?: Vec3; move?: Vec3; release?: true; gravity?: Vec3 };

/** Below this residual, with nothing new wanted, no more frames are asked for. */
const AT_REST = 1e-8;
const GRAVITIES: readonly [string, string][] = [
  ["0,0,0", "no gravity"],
  ["0,0,-9.81", "gravity −z"],
  ["0,0,9.81", "gravity +z"],
  ["0,-9.81,0", "gravity −y"],
  ["0,9.81,0", "gravity +y"],
  ["-9.81,0,0", "gravity −x"],
  ["9.81,0,0", "gravity +x"],
];

export class LiveView implements Touched, Keyed, Shared {
  tool: Tool = "drag";
  readonly depth: number;
  readonly title: string;
  /** Frames received, for programs. */
  frames = 0;
  private wanted: Request = {};
  private isWaiting = false;
  /** Whether a frame has come that has not been drawn. */
  private isFresh = false;
  private held: Hand | null = null;
  /** The largest force since the hand took hold [N]: the longest arrow. */
  private peak = 0;
  private isColoured = false;
  /** Whether the graphics processor was taken away. */
  private isBlind = false;
  /** What the stepper refused, or why it has gone; it stands until a frame comes. */
  private complaint = "";
  private laws: string[];
  private specimens: Specimen[] = [];
  private readonly surface: Surface;
  private readonly stage: Stage;
  private readonly sight: Sight;
  private readonly share: Share;
  private readonly gauge: Gauge;
  private readonly hint: Hint;
  private readonly pointer: Pointer;
  private readonly step = new Mean();
  private readonly root: HTMLElement;
  private readonly readings = element("section", { class: "panel readings live", "aria-label": "readings" });
  private readonly contrast = new Contrast();
  private readonly labels = element("div");
  private readonly warning = element("div", { class: "warning" });
  private readonly summary = new Summary();
  private readonly clock = element("div", { class: "clock" });
  private readonly legend = new Legend();
  readonly help = helpDialog("Take hold of the organ", LIVE_KEYS);
  private readonly colouring = button("Displacement", "colour by displacement", () => this.nextColouring(), "C");
  private readonly outline = button("Wireframe", "the shape at rest as a wireframe", () => this.toggleOutline(), "W");

  constructor(
    place: HTMLElement,
    private readonly link: Link,
    private readonly hello: Hello,
    private readonly isEmbedded: boolean,
  ) {
    this.surface = {
      rest: Float32Array.from(hello.rest),
      triangles: Uint32Array.from(hello.triangles),
      touchable: Uint32Array.from(hello.triangles),
      diagonal: hello.diagonal,
    };
    this.depth = 0.1 * hello.diagonal;
    this.laws = [hello.law];
    this.title = hello.name;
    const canvas = element("canvas", { class: "stage", tabindex: "0", role: "application" });
    canvas.setAttribute("aria-label", `${hello.name}: press on it to take hold of it; ? lists the keys`);
    this.stage = new Stage(canvas, lookOver(this.surface).centre, hello.diagonal, [0.2, -1, 0]);
    this.root = element("div", { class: isEmbedded ? "view is-embedded" : "view" }, canvas);
    const host = element("div", { style: "position:absolute;inset:0" });
    host.attachShadow({ mode: "open" }).append(element("style", {}, style), this.root);
    this.sight = new Sight(this.stage, () => this.specimens.map(({ body }) => body));
    this.share = new Share(this.stage, this, this.root);
    this.gauge = new Gauge(this.stage);
    this.hint = new Hint(this.stage, () => this.pointer.near(this.middle));
    const body = { hit: (ray: THREE.Raycaster) => this.hit(ray) };
    this.root.append(
      this.labels,
      this.hint.root,
      element(
        "div",
        { class: "plan" },
        this.stage.clearing,
        this.header(headsetButton(this.stage, body, this)),
        this.warning,
        this.gauge.root,
        this.legend.root,
        element("div", { class: "side" }, this.readings, this.clock),
        this.tools(),
      ),
      this.help,
      this.summary.root,
    );
    place.append(host);
    this.arrange();
    this.pointer = new Pointer(this.stage, body, this);
    listen(this.root, this);
    followTheme(this.root, () => {});
    this.stage.onFrame = () => this.frame();
    this.stage.onContext = (isLost) => {
      this.isBlind = isLost;
      this.warn();
    };
    link.onMessage = (data) => this.receive(data);
    link.onClose = (sentence) => this.complain(sentence);
  }

  // What a hand does.

  grab(hit: Hit): void {
    this.hint.end();
    const first = this.specimens[0]!;
    const displacement = first.displacementAt(hit.rest);
    this.held = { point: hit.rest, normal: first.body.normalAt(hit.rest, this.hello.radius), displacement };
    this.peak = 0;
    this.wanted = { ...this.wanted, grab: hit.rest, move: displacement, release: undefined };
  }

  move(displacement: Vec3): void {
    if (!this.held) return;
    this.held.displacement = displacement;
    this.wanted.move = displacement;
    this.ask();
  }

  release(): void {
    if (!this.held) return;
    this.held = null;
    this.specimens.forEach(({ arrow }) => arrow.hide());
    this.wanted = { ...this.wanted, grab: undefined, move: undefined, release: true };
  }

  hover(hit: Hit | null): void {
    if (this.held) return;
    const normal = hit && this.specimens[0]!.body.normalAt(hit.rest, this.hello.radius);
    for (const specimen of this.specimens) {
      if (hit) specimen.hover(hit.rest, normal!);
      else specimen.arrow.hide();
    }
    this.stage.invalidate();
  }

  contact(): Hand | null {
    return this.held;
  }

  // What tools, keys and programs do.

  /** One law, or two side by side; what the hand holds it goes on holding. */
  setLaws(laws: string[]): void {
    this.laws = laws;
    this.wanted.laws = laws;
    if (this.held) this.wanted = { ...this.wanted, grab: this.held.point, move: this.held.displacement };
    this.peak = 0;
    this.arrange();
  }

  /** Begins anew, from rest and with nobody touching. */
  reset(): void {
    this.held = null;
    this.wanted = {};
    this.setLaws(this.laws);
    this.stage.goHome();
  }

  setGravity(gravity: Vec3): void {
    this.wanted.gravity = gravity;
  }

  setTool(tool: Tool): void {
    this.tool = tool;
  }

  /** Whether the wheel is meant for the view. */
  get isInUse(): boolean {
    return !this.isEmbedded || (document.hasFocus() && this.root.matches(":focus-within"));
  }

  /** Takes hold of the surface near a point and displaces it [m]. */
  touch(point: Vec3, displacement: Vec3): void {
    this.grab({ rest: point, moved: new THREE.Vector3(...point) });
    this.move(displacement);
  }

  touchMiddle(): void {
    const hit = this.pointer.near(this.middle);
    if (!hit) return;
    this.grab(hit);
    this.nudge(0, 0, 0.25);
  }

  nudge(right: number, up: number, inward: number): void {
    if (!this.held) return this.touchMiddle();
    const by = [right * this.depth, up * this.depth, inward * this.depth] as const;
    this.move(nudged(this.stage, this.held, by));
  }

  rest(): void {
    this.release();
  }

  nextColouring(): void {
    this.isColoured = !this.isColoured;
    this.colouring.setAttribute("aria-pressed", String(this.isColoured));
    if (!this.isColoured) {
      this.legend.hide();
      this.specimens.forEach(({ body }) => body.paintTissue());
    }
    this.stage.shape(() => this.show());
  }

  nextLook(): void {
    this.sight.next();
  }

  toggleOutline(): void {
    const isOn = this.outline.getAttribute("aria-pressed") !== "true";
    this.outline.setAttribute("aria-pressed", String(isOn));
    this.specimens.forEach(({ body }) => (body.outline.visible = isOn));
    this.stage.invalidate();
  }

  toggleTheme(): void {
    toggleTheme(this.root);
  }

  /** Makes the keys work. */
  focus(): void {
    this.stage.canvas.focus({ preventScroll: true });
  }

  announce(sentence: string): void {
    this.summary.say(sentence);
  }

  /** The sentence below a picture of the hand's forces. */
  caption(): string {
    return this.held ? this.forces().join(" ") : "";
  }

  /** The state in numbers, for programs: SI units. */
  state(): Record<string, unknown> {
    return {
      frames: this.frames,
      place: this.link.place,
      laws: this.laws,
      held: this.held,
      frame: { rate: this.stage.pace.rate, step: this.step.value, drawing: this.stage.drawing.value },
      specimens: this.specimens.map(({ facts, field }) => ({ ...facts, field: Array.from(field) })),
    };
  }

  /** The middle of the first organ at rest, where it stands [m]. */
  private get middle(): Vec3 {
    const { position } = this.specimens[0]!.place;
    return new THREE.Vector3(...this.stage.centre).add(position).toArray();
  }

  /** Where a point of the first organ at rest [m] is on the canvas, in CSS pixels. */
  project(point: Vec3): { x: number; y: number } {
    return this.stage.project(new THREE.Vector3(...point).add(this.specimens[0]!.place.position));
  }

  // How it goes on.

  private frame(): void {
    this.sight.follow();
    this.gauge.follow();
    this.hint.follow(this.held === null);
    this.ask();
    if (this.isFresh) this.stage.shape(() => this.show());
    this.specimens.forEach((specimen) => specimen.label.follow(specimen.size, specimen.standing));
    const { pace, drawing } = this.stage;
    this.clock.textContent = paceInWords(pace.rate, [
      ["step", this.step.value],
      ["drawing", drawing.value],
    ]);
  }

  /** Asks for a frame where something is wanted or moves; one at a time. */
  private ask(): void {
    const isMoving = this.specimens.some(({ facts }) => facts.residual > AT_REST || facts.taken < 1 || !facts.isSettled);
    if (this.isWaiting || !this.link.isOpen) return;
    if (!isMoving && Object.keys(this.wanted).length === 0) return;
    this.link.send(JSON.stringify(this.wanted));
    this.wanted = {};
    this.isWaiting = true;
  }

  private receive(data: string | ArrayBuffer): void {
    this.isWaiting = false;
    if (typeof data === "string") return this.complain((JSON.parse(data) as { error: string }).error);
    const numbers = new Float32Array(data);
    const size = FACTS + this.surface.rest.length;
    // A frame that was under way when the laws changed is of another number of organs.
    if (numbers[0] !== this.specimens.length) return;
    this.frames += 1;
    this.specimens.forEach((specimen, k) => specimen.take(numbers.subarray(1 + k * size, 1 + (k + 1) * size)));
    this.step.add(this.specimens.reduce((sum, { facts }) => sum + facts.milliseconds, 0));
    this.complaint = "";
    this.isFresh = true;
    this.stage.invalidate();
    // An organ on its way, or a hand that has moved, does not wait for the drawing.
    if (this.specimens.some(({ facts }) => !facts.isSettled) || Object.keys(this.wanted).length > 0) this.ask();
  }

  private show(): void {
    this.isFresh = false;
    const { held, specimens } = this;
    specimens.forEach((specimen) => specimen.present());
    if (held) {
      // A force on its way may be of any size: it does not set the scale.
      const settled = specimens.filter(({ facts }) => facts.isSettled);
      this.peak = Math.max(this.peak, ...settled.map(({ size }) => size));
      const reference = this.peak || Math.max(...specimens.map(({ size }) => size));
      specimens.forEach((specimen) => specimen.hold(held, reference));
    }
    if (this.isColoured) {
      const largest = Math.max(...specimens.map(({ reach }) => reach));
      const high = this.legend.show("displacement", VIRIDIS, this.depth, largest);
      specimens.forEach((specimen) => specimen.colour(high));
    }
    const [one, other] = specimens;
    if (one && other) this.contrast.show(one, other);
    this.warn();
  }

  private warn(): void {
    const sentence = this.isBlind ? CONTEXT_LOST : this.complaint || this.trouble();
    this.warning.classList.toggle("is-shown", sentence !== "");
    if (sentence) this.warning.textContent = sentence;
    this.summary.say([this.caption(), sentence].filter(Boolean).join(" "));
  }

  /** What each organ's force is, in words. */
  private forces(): string[] {
    return this.specimens.map(
      ({ law, size, standing }) => `${spaced(law)}: ${newtons(size)}${standing === "unsettled" ? ", not settled" : ""}.`,
    );
  }

  /** What is the matter with the last frame, in words; empty where nothing is. */
  private trouble(): string {
    const named = ({ law }: Specimen) => (this.specimens.length > 1 ? ` (${spaced(law)})` : "");
    const cut = this.specimens.find(({ facts }) => facts.taken < 1);
    if (cut) return `The hand is faster than the organ${named(cut)}: a cell would turn inside out, the step is cut.`;
    const flat = this.specimens.find(({ facts }) => facts.cellsAtBound > 0);
    if (flat) return `A cell is squeezed or stretched as far as a cell may be${named(flat)}.`;
    const unstable = this.specimens.find(({ facts }) => facts.isUnstable);
    return unstable ? `The organ is about to buckle here${named(unstable)}.` : "";
  }

  private complain(sentence: string): void {
    this.complaint = sentence;
    this.warn();
  }

  /** Makes the organs anew, one for each law, side by side. */
  private arrange(): void {
    const isOther = this.laws.length !== this.specimens.length;
    for (const specimen of this.specimens) {
      this.stage.world.remove(specimen.place);
      specimen.dispose();
    }
    const names = this.hello.laws.map((law) => [law, spaced(law)] as [string, string]);
    const right = this.stage.right;
    const along = Array.from({ length: this.surface.rest.length / 3 }, (_, n) =>
      right.reduce((sum, r, i) => sum + r * this.surface.rest[3 * n + i]!, 0),
    );
    const extent = Math.max(...along) - Math.min(...along);
    const width = 1.15 * extent;
    const places = this.laws.map((_, k) => right.map((r) => r * (k - 0.5 * (this.laws.length - 1)) * width) as Vec3);
    this.specimens = this.laws.map((law, k) => {
      const choose = (chosen: string) => this.setLaws(this.laws.map((old, j) => (j === k ? chosen : old)));
      const side = this.laws.length > 1 ? (["left", "right"][k] ?? "") : "";
      const specimen = new Specimen(this.surface, this.hello.radius, this.stage, names, law, side, choose);
      specimen.place.position.set(...places[k]!);
      specimen.body.outline.visible = this.outline.getAttribute("aria-pressed") === "true";
      this.stage.world.add(specimen.place);
      this.labels.append(specimen.label.root);
      return specimen;
    });
    this.sight.renew();
    const contrast = this.laws.length > 1 ? [this.contrast.root] : [];
    const focused = this.controls().indexOf((this.root.getRootNode() as ShadowRoot).activeElement as HTMLElement);
    const isLast = focused === this.controls().length - 1;
    this.readings.replaceChildren(...this.specimens.map(({ root }) => root), ...contrast, this.pairing());
    // Whoever has chosen a law, or a second one, by key goes on from there.
    if (focused >= 0) this.controls().at(isLast ? -1 : focused)!.focus({ preventScroll: true });
    this.readings.classList.toggle("is-pair", this.laws.length > 1);
    if (isOther) this.stage.enclose(places.map((at) => ({ rest: this.surface.rest, at })));
    this.stage.invalidate();
  }

  /** The lists of laws and the button below them. */
  private controls(): HTMLElement[] {
    return [...this.readings.querySelectorAll<HTMLElement>("select, button")];
  }

  /** From one organ to two and back. */
  private pairing(): HTMLButtonElement {
    const [first] = this.laws as [string];
    const isPair = this.laws.length > 1;
    const other = first === "Linear" ? (this.hello.laws.find((law) => law !== first) ?? first) : "Linear";
    return button(isPair ? "One organ" : "Compare two laws", "one organ, or two laws in the same hand", () =>
      this.setLaws(isPair ? [first] : [first, other]),
    );
  }

  /** What a ray meets of the organs, the nearest first. */
  private hit(ray: THREE.Raycaster): Hit | null {
    const hits = this.specimens.flatMap(({ body, place }) => {
      const hit = body.hit(ray);
      return hit ? [{ rest: hit.rest, moved: hit.moved.add(place.position) }] : [];
    });
    const from = this.stage.world.worldToLocal(ray.ray.origin.clone());
    return hits.sort((a, b) => a.moved.distanceToSquared(from) - b.moved.distanceToSquared(from))[0] ?? null;
  }

  private header(headset: HTMLButtonElement): HTMLElement {
    const facts = `${this.hello.rest.length / 3} surface nodes · stepped ${this.link.place}`;
    const theme = button("◐", "light or dark", () => this.toggleTheme(), "T");
    const help = button("?", "keys and gestures", () => this.help.showModal(), "?");
    const corner = element("div", { class: "corner" }, headset, this.share.root, theme, help);
    return element("header", {}, element("h1", {}, this.hello.name), element("p", {}, facts), corner);
  }

  private tools(): HTMLElement {
    const tool = new Segments<Tool>(
      "tool",
      [
        ["push", "Push", "press on the organ, move down to push in and up to pull out"],
        ["drag", "Drag", "press on the organ and drag it in the plane of the screen"],
      ],
      (chosen) => this.setTool((tool.value = chosen)),
    );
    tool.value = this.tool;
    const gravity = choice("gravity", GRAVITIES, (value) => this.setGravity(value.split(",").map(Number) as Vec3));
    gravity.value = GRAVITIES.find(([value]) => value === this.hello.gravity.map(String).join())?.[0] ?? "0,0,0";
    const reset = button("Reset", "begin anew", () => this.reset(), "R");
    return element("nav", { class: "panel tools", "aria-label": "tools" }, tool.root, gravity, this.colouring, this.outline, this.sight.choice.root, this.sight.slider, reset);
  }
}

/** Fills the place with the view of a case, once its stepper has introduced it; rejects with a sentence. */
export function connect(place: HTMLElement, link: Link, isEmbedded: boolean): Promise<LiveView> {
  return new Promise((resolve, reject) => {
    link.onClose = (sentence) => reject(new Error(sentence));
    link.onMessage = (data) => {
      const hello = JSON.parse(data as string) as Hello | { error: string };
      if ("error" in hello) reject(new Error(hello.error));
      else resolve(new LiveView(place, link, hello, isEmbedded));
    };
  });
}

/** "SaintVenantKirchhoff" as it is written. */
function spaced(law: string): string {
  const names: Record<string, string> = {
    HolzapfelGasserOgden: "Holzapfel-Gasser-Ogden",
    MooneyRivlin: "Mooney-Rivlin",
    NeoHookean: "neo-Hookean",
    SaintVenantKirchhoff: "Saint Venant-Kirchhoff",
  };
  return names[law] ?? law;
}
