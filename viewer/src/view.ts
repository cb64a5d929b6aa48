// The view: an organ on a stage, a hand, the readings and the tools, and one state that they share.
import * as THREE from "three";
import { Arrow } from "./arrow";
import { Body, lookOver, type Hit } from "./body";
import { COLOURINGS, Painter, type Colouring } from "./colouring";
import { element, followTheme, toggleTheme } from "./dom";
import { Evaluator, type Vec3 } from "./evaluator";
import { read, written } from "./address";
import { Gauge } from "./gauge";
import { Hint } from "./hint";
import { Inside, shiftInWords, type Shift } from "./inside";
import { listen, type Keyed } from "./keys";
import { ForceLabel } from "./label";
import { Legend } from "./legend";
import { Modes } from "./modes";
import { Mean, paceInWords } from "./pace";
import { Plan } from "./plan";
import { nudged, Pointer, type Tool, type Touched } from "./pointer";
import { Readings } from "./readings";
import { Share, type Shared } from "./share";
import { LOOKINGS, Sight, type Looking } from "./sight";
import { Speech } from "./speech";
import { Spring } from "./spring";
import { Stage } from "./stage";
import { Tools } from "./tools";
import { NOBODY, told, TouchState, type Told } from "./touchstate";
import { typicalForce } from "./typicalforce";
import { Walk } from "./walk";
import { headsetButton } from "./xr";

/** What moves the organ at the moment. */
type Activity = "rest" | "held" | "kept" | "springing" | "path" | "modes";

export class View implements Touched, Keyed, Shared {
  readonly hands = 1;
  tool: Tool = "push";
  order: number;
  readonly title: string;
  readonly depth: number;
  private activity: Activity = "rest";
  private isKeeping = false;
  private touching: TouchState | null = null;
  private readonly spring = new Spring();
  private readonly reference: number;
  private readonly plan: Plan;
  private readonly speech: Speech;
  private readonly clock = element("div", { class: "clock" });
  private readonly readings: Readings;
  private readonly legend = new Legend();
  /** Work after a touch has changed. */
  onTouch: () => void = () => {};
  readonly sight: Sight;
  readonly share: Share;
  private readonly gauge: Gauge;
  private readonly hint: Hint;
  private readonly inside: Inside;
  private readonly tools: Tools;
  private readonly modes: Modes;
  private readonly stage: Stage;
  private readonly body: Body;
  private readonly painter: Painter;
  private readonly arrow: Arrow;
  private readonly label: ForceLabel;
  private readonly answering = new Mean();
  private readonly pointer: Pointer;
  private readonly deaf: (() => void)[];
  private readonly walk: Walk;

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
    isEmbedded: boolean,
  ) {
    const { metadata } = evaluator.about;
    this.depth = metadata.depth;
    this.order = metadata.order;
    this.title = metadata.user?.name ?? "Organ";
    this.plan = new Plan(this.title, "Press on the organ to touch it.", isEmbedded);
    const { root } = this.plan;
    const { centre, facing } = lookOver(evaluator);
    this.stage = new Stage(this.plan.canvas, centre, metadata.diagonal, facing);
    this.speech = new Speech(this.stage);
    this.body = new Body(evaluator);
    this.painter = new Painter(evaluator, this.body, this.legend);
    this.arrow = new Arrow(metadata.diagonal, 0.5 * metadata.radius);
    this.inside = new Inside(evaluator.rest, evaluator.notes.inside ?? []);
    this.stage.world.add(this.body.mesh, this.body.outline, this.arrow.group, this.inside.group);
    this.sight = new Sight(this.stage, () => [this.body]);
    this.walk = new Walk(evaluator, this.body, this.stage.world);
    if (evaluator.notes.inside?.length) this.sight.choose("translucent");
    this.readings = new Readings(metadata.order, (order) => this.setOrder(order));
    this.modes = new Modes(evaluator, this.body, this.stage.towards, () => this.stage.invalidate());
    this.share = new Share(this.stage, this, root);
    this.gauge = new Gauge(this.stage, evaluator.notes.axes);
    this.label = new ForceLabel(this.stage, this.arrow, this.gauge.root);
    this.hint = new Hint(this.stage, () => this.pointer.near(this.middle));
    this.tools = new Tools(this, headsetButton(this.stage, this.body, this));
    const side = element("div", { class: "side" }, this.readings.root, this.inside.root, this.modes.root, this.clock);
    this.plan.fill(
      place,
      [this.label.root, this.hint.root],
      [this.stage.clearing, this.tools.header, this.speech.warning, this.gauge.root, this.legend.root, side, this.tools.root],
      [this.help, this.speech.summary.root],
    );
    this.stage.enclose([{ rest: evaluator.rest, at: [0, 0, 0] }]);
    this.reference = typicalForce(evaluator, this.body);
    this.pointer = new Pointer(this.stage, this.body, this);
    this.deaf = [listen(root, this), followTheme(root, () => this.readings.redraw())];
    this.stage.onFrame = (seconds) => this.frame(seconds);
    this.setOrder(this.order);
    this.setColouring("tissue");
    this.rest();
    if (!isEmbedded) this.follow(location.hash);
  }

  // What a hand does.

  grab(hit: Hit): void {
    this.stop();
    if (!(this.isKeeping && this.touching?.covers(hit.rest))) this.touchAt(hit.rest);
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
    this.spring.release(this.touching.displacement);
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
    this.painter.colouring = colouring;
    this.tools.colouring.value = colouring;
    this.show();
  }

  nextColouring(): void {
    this.setColouring(this.painter.next);
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
    return this.plan.isInUse;
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
    if (!this.walk.begin()) return;
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
    this.inside.root.hidden = true;
    this.modes.show();
  }

  stepMode(by: number): void {
    if (this.activity === "modes") this.modes.step(by);
  }

  toggleTheme(): void {
    toggleTheme(this.plan.root);
    this.readings.redraw();
  }

  /** Makes the keys work. */
  focus(): void {
    this.plan.focus();
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
      ...(touching?.numbers ?? NOBODY),
      looking: this.sight.looking,
      stiffness_factor: this.evaluator.factor,
      inside: this.shifts(),
      shapes: this.walk.shapes,
      frame: { rate: this.stage.pace.rate, answer: this.answering.value, drawing: this.stage.drawing.value },
    };
  }

  /** The touch, for whom it is told to. */
  get told(): Told {
    return told(this.touching);
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
    this.speech.dispose();
    this.share.dispose();
    this.readings.dispose();
    this.pointer.dispose();
    this.arrow.dispose();
    this.walk.dispose();
    this.body.dispose();
    this.inside.dispose();
    this.stage.dispose();
    this.evaluator.dispose();
    this.plan.remove();
  }

  announce(sentence: string): void {
    this.speech.summary.say(sentence);
  }

  /** The touch as one would say it: the sentence below a picture. */
  caption(): string {
    const { touching } = this;
    if (!touching || this.activity === "path") return "";
    return [touching.inShort, ...this.shifts()!.map((shift) => `${shift.name} moved ${shiftInWords(shift)}.`)].join(" ");
  }

  /** What an address carries that shows this touch, seen like this. */
  hash(): string {
    const { touching } = this;
    return written({
      ...(touching && { point: touching.point, displacement: touching.displacement }),
      order: this.order,
      colour: this.painter.colouring,
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
    if (this.activity === "springing") this.comeBack(seconds);
    else if (this.activity === "path") this.walkOn(seconds);
    else if (this.activity === "modes") {
      this.inside.move(this.modes.advance(seconds));
      this.stage.invalidate();
    }
    this.sight.follow();
    this.gauge.follow();
    this.hint.follow(this.activity === "rest");
    this.label.follow(Math.hypot(...(this.touching?.force ?? [])), this.touching?.standing(this.order) ?? "sound");
    const { pace, drawing } = this.stage;
    this.clock.textContent = paceInWords(pace.rate, [
      ["answer", this.answering.value],
      ["drawing", drawing.value],
    ]);
  }

  private comeBack(seconds: number): void {
    const left = this.spring.advance(seconds);
    if (left) this.move(left);
    else this.rest();
  }

  private walkOn(seconds: number): void {
    const station = this.walk.advance(seconds, this.order);
    this.touching = new TouchState(this.evaluator, station.point, station.normal);
    this.move(station.displacement);
  }

  private touchAt(point: Vec3): void {
    const { radius } = this.evaluator.about.metadata;
    this.touching = new TouchState(this.evaluator, point, this.body.normalAt(point, radius));
    this.touching.displace([0, 0, 0], this.order);
  }

  /** Ends what moved the organ by itself. */
  private stop(): void {
    if (this.activity === "modes") this.modes.hide();
    this.readings.root.hidden = false;
    this.inside.root.hidden = this.inside.isEmpty;
    this.tools?.press("modes", false);
    this.tools?.press("path", false);
    this.walk.end();
    if (this.activity === "path" || this.activity === "modes") {
      this.activity = "rest";
      this.setColouring(this.painter.colouring);
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
      this.arrow.show(at, touching.force, touching.normal, this.reference, touching.standing(order));
      touching.orders.forEach((reading, k) => this.readings.showOrder(k + 1, reading));
    }
    this.inside.show(this.shifts(), touching?.answer.shapeTrust === "trusted" && !touching.doubt(order));
    const [force, depth] = [Math.hypot(...(touching?.force ?? [])), touching?.depth ?? 0];
    this.readings.show(touching?.answer ?? null, force, depth);
    this.readings.draw(touching?.curves ?? null, order, this.depth, touching && { depth, force });
    this.painter.show(touching, order);
    this.onTouch();
    this.speech.say(this.caption(), this.touching?.warning(this.order) ?? "");
  }

  /** How far the parts within have moved; null where nobody touches. */
  private shifts(): Shift[] | null {
    const { touching, order } = this;
    return touching && this.inside.shifts(touching.field, touching.fieldError(order), touching.typical);
  }
}
