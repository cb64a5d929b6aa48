// The view: an organ on a stage, a hand, the readings and the tools, and one state that they share.
import * as THREE from "three";
import { Arrow } from "./arrow";
import { Body, lookOver, type Hit } from "./body";
import { INFERNO, VIRIDIS, type ColourMap } from "./colour";
import { element, fixed, followTheme, newtons, toggleTheme } from "./dom";
import { Evaluator, type Vec3 } from "./evaluator";
import { read, written } from "./address";
import { Gauge } from "./gauge";
import { Hint } from "./hint";
import { Inside, shiftInWords, type Shift } from "./inside";
import { listen, type Keyed } from "./keys";
import { ForceLabel } from "./label";
import { Legend } from "./legend";
import { LoadPath } from "./loadpath";
import { Modes } from "./modes";
import { Mean, paceInWords } from "./pace";
import { nudged, Pointer, type Tool, type Touched } from "./pointer";
import { Readings } from "./readings";
import { Share, type Shared } from "./share";
import { LOOKINGS, Sight, type Looking } from "./sight";
import { CONTEXT_LOST, Stage } from "./stage";
import style from "./style.css?inline";
import { Summary } from "./summary";
import { Tools, type Colouring } from "./tools";
import { TouchState } from "./touchstate";
import { Trail } from "./trail";
import { headsetButton } from "./xr";

/** What moves the organ at the moment. */
type Activity = "rest" | "held" | "kept" | "springing" | "path" | "modes";

const SPRING_SECONDS = 0.22;
const COLOURINGS: readonly Colouring[] = ["tissue", "displacement", "error"];

export class View implements Touched, Keyed, Shared {
  tool: Tool = "push";
  order: number;
  readonly title: string;
  readonly depth: number;
  private activity: Activity = "rest";
  private colouring: Colouring = "tissue";
  private isKeeping = false;
  /** Whether the graphics processor was taken away. */
  private isBlind = false;
  private touching: TouchState | null = null;
  private released = { at: 0, displacement: [0, 0, 0] as Vec3 };
  private readonly reference: number;
  private readonly magnitude: Float32Array;
  private readonly host: HTMLElement;
  private readonly root: HTMLElement;
  private readonly canvas = element("canvas", { class: "stage", tabindex: "0", role: "application" });
  private readonly warning = element("div", { class: "warning" });
  private readonly summary = new Summary();
  private readonly clock = element("div", { class: "clock" });
  private readonly readings: Readings;
  private readonly legend = new Legend();
  readonly sight: Sight;
  readonly share: Share;
  private readonly gauge: Gauge;
  private readonly hint: Hint;
  private readonly inside: Inside;
  private readonly tools: Tools;
  private readonly modes: Modes;
  private readonly stage: Stage;
  private readonly body: Body;
  private readonly arrow: Arrow;
  private readonly label: ForceLabel;
  private readonly answering = new Mean();
  private readonly pointer: Pointer;
  private readonly deaf: (() => void)[];
  private path: LoadPath | null = null;
  private trail: Trail | null = null;

  /**
   * Reads a model file and fills the place with its view; throws a sentence where the file is no model, or nothing can be
   * drawn. Embedded in something that scrolls, the view takes the wheel only while it has the focus.
   */
  static async mount(place: HTMLElement, model: Uint8Array, isEmbedded = false): Promise<View> {
    return new View(place, await Evaluator.load(model), isEmbedded);
  }

  private constructor(
    place: HTMLElement,
    readonly evaluator: Evaluator,
    private readonly isEmbedded: boolean,
  ) {
    const { metadata } = evaluator.about;
    this.depth = metadata.depth;
    this.order = metadata.order;
    this.title = metadata.user?.name ?? "Organ";
    this.magnitude = new Float32Array(evaluator.about.n_surface);
    this.canvas.setAttribute("aria-label", `${this.title}: press on it to touch it; ? lists the keys`);
    const { centre, facing } = lookOver(evaluator);
    this.stage = new Stage(this.canvas, centre, metadata.diagonal, facing);
    this.root = element("div", { class: isEmbedded ? "view is-embedded" : "view" }, this.canvas);
    this.host = element("div", { style: "position:absolute;inset:0" });
    this.host.attachShadow({ mode: "open" }).append(element("style", {}, style), this.root);
    this.body = new Body(evaluator);
    this.arrow = new Arrow(metadata.diagonal, 0.5 * metadata.radius);
    this.label = new ForceLabel(this.stage, this.arrow);
    this.inside = new Inside(evaluator.rest, evaluator.notes.inside ?? []);
    this.stage.world.add(this.body.mesh, this.body.outline, this.arrow.group, this.inside.group);
    this.sight = new Sight(this.stage, () => [this.body]);
    if (evaluator.notes.inside?.length) this.sight.choose("translucent");
    this.readings = new Readings(metadata.order, (order) => this.setOrder(order));
    this.modes = new Modes(evaluator, this.body, this.stage.towards, () => this.stage.invalidate());
    this.share = new Share(this.stage, this, this.root);
    this.gauge = new Gauge(this.stage, evaluator.notes.axes);
    this.hint = new Hint(this.stage, () => this.pointer.near(this.middle));
    this.tools = new Tools(this, headsetButton(this.stage, this.body, this));
    this.root.append(
      this.label.root,
      this.hint.root,
      element(
        "div",
        { class: "plan" },
        this.stage.clearing,
        this.tools.header,
        this.warning,
        this.gauge.root,
        this.legend.root,
        element("div", { class: "side" }, this.readings.root, this.inside.root, this.modes.root, this.clock),
        this.tools.root,
      ),
      this.help,
      this.summary.root,
    );
    place.append(this.host);
    this.stage.enclose([{ rest: evaluator.rest, at: [0, 0, 0] }]);
    this.reference = this.referenceForce();
    this.pointer = new Pointer(this.stage, this.body, this);
    this.deaf = [listen(this.root, this), followTheme(this.root, () => this.readings.redraw())];
    this.stage.onContext = (isLost) => {
      this.isBlind = isLost;
      this.warn();
    };
    this.stage.onFrame = (seconds) => this.frame(seconds);
    this.setOrder(this.order);
    this.setColouring("tissue");
    this.rest();
    if (!isEmbedded) this.follow(location.hash);
  }

  // What a hand does.

  grab(hit: Hit): void {
    this.stop();
    const isAgain = this.touching !== null && this.isKeeping && this.reaches(hit.rest);
    if (!isAgain) this.touchAt(hit.rest);
    this.activity = "held";
    this.hint.end();
  }

  move(displacement: Vec3): void {
    if (!this.touching) return;
    const began = performance.now();
    this.touching.displace(displacement, this.order);
    this.answering.add(performance.now() - began);
    this.show();
  }

  release(): void {
    if (this.activity !== "held") return;
    if (this.isKeeping || !this.touching) {
      this.activity = "kept";
      return;
    }
    this.released = { at: 0, displacement: this.touching.displacement };
    this.activity = "springing";
  }

  hover(hit: Hit | null): void {
    if (this.activity !== "rest") return;
    if (hit) this.arrow.hover(hit.rest, this.body.normalAt(hit.rest, this.evaluator.about.metadata.radius));
    else this.arrow.hide();
    this.stage.invalidate();
  }

  contact(): { normal: Vec3; displacement: Vec3 } | null {
    return this.touching;
  }

  // What tools, keys and programs do.

  /** Touches the surface near a point [m] and displaces the contact [m]. */
  touch(point: Vec3, displacement: Vec3): void {
    this.stop();
    this.touchAt(point);
    this.activity = "kept";
    this.move(displacement);
  }

  /** Touches what lies under the middle of the canvas. */
  touchMiddle(): void {
    const hit = this.pointer.near(this.middle);
    if (!hit) return;
    this.grab(hit);
    this.activity = "kept";
    this.move(this.touching!.normal.map((x) => -0.25 * this.depth * x) as Vec3);
  }

  nudge(right: number, up: number, inward: number): void {
    if (!this.touching) return this.touchMiddle();
    const by = [right * this.depth, up * this.depth, inward * this.depth] as const;
    this.activity = "kept";
    this.move(nudged(this.stage, this.touching, by));
  }

  /** Lets go, whatever moved the organ. */
  rest(): void {
    this.stop();
    this.activity = "rest";
    this.touching = null;
    this.body.move(null);
    this.inside.move(null);
    this.arrow.hide();
    for (let p = 1; p <= this.evaluator.about.metadata.order; p++) this.readings.showOrder(p, null);
    this.show();
  }

  setOrder(order: number): void {
    if (order < 1 || order > this.evaluator.about.metadata.order) return;
    this.order = order;
    this.readings.choose(order);
    this.touching?.choose(order);
    this.show();
  }

  setColouring(colouring: Colouring): void {
    this.colouring = colouring;
    this.tools.colouring.value = colouring;
    this.show();
  }

  nextColouring(): void {
    this.setColouring(COLOURINGS[(COLOURINGS.indexOf(this.colouring) + 1) % COLOURINGS.length]!);
  }

  /** All stiffnesses of the organ times a factor, where that is exact: about a rest that is free of stress. */
  setStiffness(factor: number): void {
    if (!this.evaluator.notes.is_stress_free || !(factor > 0)) return;
    this.evaluator.factor = factor;
    this.tools.sayStiffness(factor);
    if (this.touching) this.move(this.touching.displacement);
  }

  /** Whether the wheel is meant for the view. */
  get isInUse(): boolean {
    return !this.isEmbedded || (document.hasFocus() && this.root.matches(":focus-within"));
  }

  setTool(tool: Tool): void {
    this.tool = tool;
    this.tools.tool.value = tool;
  }

  setKeeping(isKeeping: boolean): void {
    this.isKeeping = isKeeping;
    this.tools.press("keep", isKeeping);
    if (!isKeeping && this.activity === "kept") {
      this.activity = "held";
      this.release();
    }
  }

  toggleKeeping(): void {
    this.setKeeping(!this.isKeeping);
  }

  nextLook(): void {
    this.sight.next();
  }

  toggleOutline(): void {
    this.body.outline.visible = !this.body.outline.visible;
    this.tools.press("outline", this.body.outline.visible);
    this.stage.invalidate();
  }

  togglePath(): void {
    if (this.activity === "path") return this.rest();
    this.rest();
    this.path ??= new LoadPath(this.evaluator, this.body);
    if (this.path.stations.length === 0) return;
    this.path.restart();
    this.trail ??= new Trail(this.evaluator, this.path.stations);
    this.stage.world.add(this.trail.group);
    this.activity = "path";
    this.tools.press("path", true);
  }

  toggleModes(): void {
    if (this.activity === "modes") return this.rest();
    this.rest();
    this.activity = "modes";
    this.tools.press("modes", true);
    this.legend.hide();
    this.readings.root.hidden = true;
    this.modes.show();
  }

  stepMode(by: number): void {
    if (this.activity === "modes") this.modes.step(by);
  }

  toggleTheme(): void {
    toggleTheme(this.root);
    this.readings.redraw();
  }

  /** Makes the keys work. */
  focus(): void {
    this.canvas.focus({ preventScroll: true });
  }

  get help(): HTMLDialogElement {
    return this.tools.help;
  }

  reset(): void {
    this.rest();
    this.stage.goHome();
  }

  /** The state in numbers, for programs: SI units. */
  state(): Record<string, unknown> {
    const { touching } = this;
    return {
      activity: this.activity,
      order: this.order,
      point: touching?.point ?? null,
      displacement: touching?.displacement ?? null,
      force: touching?.force ?? null,
      stiffness: touching?.answer.stiffness ?? null,
      error_estimate: touching?.answer.error ?? null,
      is_trusted: touching ? touching.answer.trust === "trusted" : null,
      shape_error_estimate: touching?.answer.shapeError ?? null,
      is_shape_trusted: touching ? touching.answer.shapeTrust === "trusted" : null,
      field: touching ? Array.from(touching.field) : null,
      orders: touching?.orders ?? null,
      looking: this.sight.looking,
      stiffness_factor: this.evaluator.factor,
      inside: this.shifts(),
      shapes: this.trail?.shapes ?? 0,
      frame: { rate: this.stage.pace.rate, answer: this.answering.value, drawing: this.stage.drawing.value },
    };
  }

  /** The middle of the organ at rest [m]. */
  get middle(): Vec3 {
    return this.stage.centre;
  }

  /** Where a surface point at rest [m] is on the canvas, in CSS pixels. */
  project(point: Vec3): { x: number; y: number } {
    return this.stage.project(new THREE.Vector3(...point));
  }

  dispose(): void {
    this.deaf.forEach((end) => end());
    this.summary.dispose();
    this.share.dispose();
    this.readings.dispose();
    this.pointer.dispose();
    this.arrow.dispose();
    this.trail?.dispose();
    this.body.dispose();
    this.inside.dispose();
    this.stage.dispose();
    this.evaluator.dispose();
    this.host.remove();
  }

  announce(sentence: string): void {
    this.summary.say(sentence);
  }

  /** The sentence below a picture of the touch. */
  caption(): string {
    return this.inShort();
  }

  /** What an address carries that shows this touch, seen like this. */
  hash(): string {
    const { touching } = this;
    return written({
      ...(touching && { point: touching.point, displacement: touching.displacement }),
      order: this.order,
      colour: this.colouring,
      look: this.sight.looking,
      from: this.stage.camera.position.toArray(),
    });
  }

  /** Does what an address says. */
  follow(hash: string): void {
    const { point, displacement, order, colour, look, from } = read(hash);
    if (order) this.setOrder(order);
    if (COLOURINGS.includes(colour as Colouring)) this.setColouring(colour as Colouring);
    if (from) this.stage.lookFrom(from);
    if (LOOKINGS.includes(look as Looking)) this.sight.choose(look as Looking);
    if (point && displacement && this.evaluator.touch(point)) this.touch(point, displacement);
  }

  // How it is shown.

  private frame(seconds: number): void {
    if (this.activity === "springing") this.spring(seconds);
    else if (this.activity === "path") this.walk(seconds);
    else if (this.activity === "modes") {
      this.inside.move(this.modes.advance(seconds));
      this.stage.invalidate();
    }
    this.sight.follow();
    this.gauge.follow();
    this.hint.follow(this.activity === "rest");
    const { touching } = this;
    if (touching) this.label.follow(Math.hypot(...touching.force), touching.doubt(this.order) ? "doubtful" : "sound");
    else this.label.root.hidden = true;
    const { pace, drawing } = this.stage;
    this.clock.textContent = paceInWords(pace.rate, [
      ["answer", this.answering.value],
      ["drawing", drawing.value],
    ]);
  }

  private spring(seconds: number): void {
    this.released.at += seconds;
    const left = 1 - this.released.at / SPRING_SECONDS;
    if (left <= 0 || matchMedia("(prefers-reduced-motion: reduce)").matches) return this.rest();
    this.move(this.released.displacement.map((x) => x * left * left) as Vec3);
  }

  private walk(seconds: number): void {
    const station = this.path!.advance(seconds);
    this.trail!.reach(this.path!.gone, this.order);
    this.touching = new TouchState(this.evaluator, station.point, station.normal);
    this.move(station.displacement);
  }

  private touchAt(point: Vec3): void {
    const { radius } = this.evaluator.about.metadata;
    this.touching = new TouchState(this.evaluator, point, this.body.normalAt(point, radius));
    this.touching.displace([0, 0, 0], this.order);
  }

  /** Whether a point is within the contact that is kept. */
  private reaches(point: Vec3): boolean {
    const { radius } = this.evaluator.about.metadata;
    return Math.hypot(...point.map((x, i) => x - this.touching!.point[i]!)) < 0.6 * radius;
  }

  /** Ends what moved the organ by itself. */
  private stop(): void {
    if (this.activity === "modes") this.modes.hide();
    this.readings.root.hidden = false;
    this.tools?.press("modes", false);
    this.tools?.press("path", false);
    this.trail?.clear();
    this.trail?.group.removeFromParent();
    if (this.activity === "path" || this.activity === "modes") {
      this.activity = "rest";
      this.setColouring(this.colouring);
    }
  }

  private show(): void {
    if (this.activity !== "modes") this.stage.shape(() => this.shape());
  }

  private shape(): void {
    const { touching, order } = this;
    if (touching) {
      this.body.move(touching.field);
      this.inside.move(touching.field);
      const at = touching.point.map((x, i) => x + touching.displacement[i]!) as Vec3;
      this.arrow.show(at, touching.force, touching.normal, this.reference, touching.doubt(order) ? "doubtful" : "sound");
      touching.orders.forEach((reading, k) => this.readings.showOrder(k + 1, reading));
    }
    this.inside.show(this.shifts(), touching?.answer.shapeTrust === "trusted" && !touching.doubt(order));
    const force = touching ? Math.hypot(...touching.force) : 0;
    const depth = touching?.depth ?? 0;
    this.readings.show(touching?.answer ?? null, force, depth);
    this.readings.draw(touching?.curves ?? null, order, this.depth, touching && { depth, force });
    this.colour();
    this.warn();
  }

  private colour(): void {
    const { touching, magnitude } = this;
    if (this.colouring === "tissue") {
      this.body.paintTissue();
      return this.legend.hide();
    }
    magnitude.fill(0);
    if (this.colouring === "displacement") {
      const field = touching?.field;
      if (field) for (let n = 0; n < magnitude.length; n++) magnitude[n] = Math.hypot(...field.subarray(3 * n, 3 * n + 3));
      return this.paint("displacement", VIRIDIS, this.depth);
    }
    touching?.localError(this.order, magnitude);
    const highest = this.evaluator.about.metadata.order;
    this.paint(this.order < highest ? `distance from order ${highest}` : "estimated error", INFERNO, 0.05 * this.depth);
  }

  /** Colours by what the magnitudes are [m], on a scale that reaches to a length [m] at least. */
  private paint(name: string, map: ColourMap, length: number): void {
    const largest = this.magnitude.reduce((most, x) => Math.max(most, x), 0);
    this.body.paint(this.magnitude, 0, this.legend.show(name, map, length, largest), map);
  }

  private warn(): void {
    const sentence = this.isBlind ? CONTEXT_LOST : (this.touching?.warning(this.order) ?? "");
    this.warning.classList.toggle("is-shown", sentence !== "");
    if (sentence) this.warning.textContent = sentence;
    this.summary.say([this.inShort(), sentence].filter(Boolean).join(" "));
  }

  /** The touch as one would say it. */
  private inShort(): string {
    const { touching } = this;
    if (!touching || this.activity === "path") return "";
    const shifts = this.shifts()!.map((shift) => `${shift.name} moved ${shiftInWords(shift)}.`);
    return [`${newtons(Math.hypot(...touching.force))} at a depth of ${fixed(1000 * touching.depth, 1)} mm.`, ...shifts].join(" ");
  }

  /** How far the parts within have moved; null where nobody touches. */
  private shifts(): Shift[] | null {
    const { touching, order } = this;
    return touching && this.inside.shifts(touching.field, touching.fieldError(order), touching.typical);
  }

  /** A typical force [N], so that arrows are of a readable length: the median over positions, pushed in half the depth. */
  private referenceForce(): number {
    const { evaluator, body } = this;
    const { radius } = evaluator.about.metadata;
    const step = Math.max(1, Math.floor(evaluator.positions.length / 40));
    const forces: number[] = [];
    for (let p = 0; p < evaluator.positions.length; p += step) {
      const row = 3 * evaluator.positions[p]!;
      const point = evaluator.touch([...evaluator.rest.subarray(row, row + 3)] as Vec3);
      if (!point) continue;
      const push = body.normalAt(point, radius).map((x) => -0.5 * this.depth * x) as Vec3;
      forces.push(Math.hypot(...evaluator.evaluate(push).force));
    }
    forces.sort((a, b) => a - b);
    return forces[Math.floor(forces.length / 2)] || 1;
  }
}
