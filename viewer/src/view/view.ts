// The view of a reduced model: what hands, tools, keys and programs do to the organ, and what it does by itself.
import * as THREE from "three";
import { lookOver, type Hit } from "../stage/body";
import type { Colouring } from "./colouring";
import { Demonstration } from "./demonstration";
import { Display } from "./display";
import { element, followTheme, toggleTheme } from "../base/dom";
import { Evaluator, type Vec3 } from "../model/evaluator";
import { addressOf, followAddress } from "./address";
import { Hint } from "../panels/hint";
import { listen, type Keyed } from "../hands/keys";
import { Mean } from "../base/pace";
import { Plan } from "../panels/plan";
import { nudged, Pointer, type Reading, type Tool, type Touched } from "../hands/pointer";
import { Share, type Shared } from "../panels/share";
import { Sight } from "../stage/sight";
import { Spring } from "../hands/spring";
import { Stage } from "../stage/stage";
import { UNTOUCHED, type Told } from "../touch/told";
import { Tools } from "./tools";
import { BEYOND, NOBODY, told, TouchState } from "../touch/touchstate";
import { TwoHands } from "./twohands";
import { headsetButton } from "../hands/xr";

/** What moves the organ at the moment. */
type Activity = "rest" | "held" | "kept" | "springing" | "path" | "modes";

export class View implements Touched, Keyed, Shared {
  tool: Tool = "push";
  order: number;
  readonly title: string;
  readonly depth: number;
  readonly reach: number;
  private activity: Activity = "rest";
  private isKeeping = false;
  touching: TouchState | null = null;
  /** The hand that touches the model. */
  private owner = 0;
  private readonly spring = new Spring();
  private readonly plan: Plan;
  /** Work after a touch has changed. */
  onTouch: () => void = () => {};
  readonly sight: Sight;
  readonly share: Share;
  private readonly hint: Hint;
  private readonly tools: Tools;
  private readonly demonstration: Demonstration;
  readonly stage: Stage;
  readonly display: Display;
  private readonly answering = new Mean();
  private readonly pointer: Pointer;
  private readonly deaf: (() => void)[];
  private readonly two: TwoHands;

  /**
   * Reads a model file and fills the place with its view; throws a sentence where the file is no model, or nothing can be
   * drawn. Embedded in something that scrolls, the view takes the wheel only while it has the focus.
   */
  static async mount(place: HTMLElement, model: Uint8Array, isEmbedded = false, caseUrl: string | null = null): Promise<View> {
    return new View(place, await Evaluator.load(model), isEmbedded, caseUrl);
  }

  constructor(
    place: HTMLElement,
    readonly evaluator: Evaluator,
    isEmbedded = false,
    /** A case of the same organ, which answers two hands without probes. */
    caseUrl: string | null = null,
  ) {
    const { metadata } = evaluator.about;
    this.depth = metadata.depth;
    this.reach = BEYOND * metadata.depth;
    this.order = metadata.order;
    this.title = metadata.user?.name ?? "Organ";
    this.plan = new Plan(this.title, "Press on the organ to touch it.", isEmbedded);
    const { root } = this.plan;
    const { centre, facing } = lookOver(evaluator);
    this.stage = new Stage(this.plan.canvas, centre, metadata.diagonal, facing);
    this.display = new Display(evaluator, this.stage, (order) => this.setOrder(order));
    const { inside, readings, speech, gauge, legend, clock, label } = this.display;
    this.two = new TwoHands(evaluator, this.stage, this.display, caseUrl, () => this.sight.renew());
    this.sight = new Sight(this.stage, () => this.two.bodies);
    if (evaluator.notes.inside?.length) this.sight.choose("translucent");
    this.demonstration = new Demonstration(evaluator, this.stage, this.display, (button, isOn) => this.tools.press(button, isOn));
    this.share = new Share(this.stage, this, root);
    this.hint = new Hint(this.stage, () => this.pointer.near(this.middle));
    const touchable = { hit: (ray: THREE.Raycaster) => this.two.body.hit(ray) };
    this.tools = new Tools(this, headsetButton(this.stage, touchable, this));
    const panels = [readings.root, this.two.readings, inside.root, this.demonstration.root, clock];
    const side = element("div", { class: "side" }, ...panels);
    this.plan.fill(
      place,
      [label.root, this.two.labels, this.hint.root],
      [this.stage.clearing, this.tools.header, speech.warning, gauge.root, legend.root, side, this.tools.root],
      [this.help, speech.summary.root],
    );
    this.stage.enclose([{ points: evaluator.rest, at: [0, 0, 0] }]);
    this.pointer = new Pointer(this.stage, touchable, this);
    this.deaf = [listen(root, this), followTheme(root, () => readings.redraw())];
    this.stage.onFrame = (seconds) => this.frame(seconds);
    this.setOrder(this.order);
    this.setColouring("tissue");
    this.rest();
    if (!isEmbedded) this.deaf.push(followAddress(this));
  }

  // What a hand does.

  /** How many hands may touch at once. */
  get hands(): number {
    return this.two.count;
  }

  expectTwo(): Promise<void> {
    return this.two.expect();
  }

  grab(hit: Hit, hand = 0): void {
    if (this.joins(hand)) {
      this.two.join(this.touching!, this.owner, hit, hand);
      return this.show();
    }
    this.owner = hand;
    this.stop();
    if (!(this.isKeeping && this.touching?.covers(hit.rest))) this.touchAt(hit.rest, this.two.hasProbe);
    this.activity = "held";
    this.hint.end();
  }

  move(displacement: Vec3, hand = this.owner): void {
    if (!this.touching) return;
    const began = performance.now();
    if (!this.two.isPlaying) this.touching.displace(displacement, this.order);
    else if (!this.two.move(displacement, hand)) return;
    this.answering.add(performance.now() - began);
    this.show();
  }

  release(hand = this.owner): void {
    if (this.activity !== "held" || (this.two.isPlaying && this.leaves(hand))) return;
    if (this.isKeeping || !this.touching) {
      this.activity = "kept";
      return;
    }
    this.spring.release(this.touching.motion);
    this.activity = "springing";
  }

  hover(hit: Hit | null): void {
    if (this.activity === "rest") this.display.hover(hit && hit.rest);
  }

  contact(hand = this.owner): { normal: Vec3; displacement: Vec3 } | null {
    if (this.two.isPlaying) return this.two.contact(hand);
    return this.touching && { normal: this.touching.normal, displacement: this.touching.motion };
  }

  reading(hand = this.owner): Reading | null {
    if (this.two.isShown) return this.two.reading(hand);
    return this.touching && hand === this.owner ? this.display.reading(this.touching, this.order) : null;
  }

  /** Whether a hand takes hold while another one does. */
  private joins(hand: number): boolean {
    return this.hands > 1 && this.activity === "held" && this.touching !== null && (this.two.isPlaying || hand !== this.owner);
  }

  /** One of two hands lets go: whether the other one holds on. */
  private leaves(hand: number): boolean {
    const { isHeld, touching } = this.two.leave(hand, this.order);
    if (isHeld) this.owner = 1 - hand;
    this.touching = touching ?? this.touching;
    this.show();
    return isHeld;
  }

  // What tools, keys and programs do.

  /** Touches the surface near a point [m] and displaces the contact [m]. */
  touch(point: Vec3, displacement: Vec3): void {
    this.stop();
    this.takeProbe(false);
    this.touchAt(point);
    this.activity = "kept";
    this.move(displacement);
  }

  /** Touches what lies under the middle of the canvas. */
  touchMiddle(): void {
    const hit = this.activity === "held" || this.two.isPlaying ? null : this.pointer.near(this.middle);
    if (!hit) return;
    this.grab(hit);
    this.activity = "kept";
    this.move(this.touching!.normal.map((x) => -0.25 * this.depth * x) as Vec3);
  }

  nudge(right: number, up: number, inward: number): void {
    if (!this.touching) return this.touchMiddle();
    const by = [right * this.depth, up * this.depth, inward * this.depth] as const;
    if (!this.two.isPlaying) {
      // A hand that holds on says itself where the contact goes.
      if (this.activity === "held") return;
      this.activity = "kept";
    }
    this.move(nudged(this.stage, this.contact()!, by));
  }

  /** Lets go, whatever moved the organ. */
  rest(): void {
    this.stop();
    this.activity = "rest";
    this.touching = null;
    this.display.rest();
    this.show();
  }

  setOrder(order: number): void {
    if (order < 1 || order > this.evaluator.about.metadata.order) return;
    this.order = order;
    this.display.readings.choose(order);
    this.touching?.choose(order);
    this.show();
  }

  setColouring(colouring: Colouring): void {
    this.display.painter.colouring = colouring;
    this.tools.colouring.value = colouring;
    this.show();
  }

  nextColouring(): void {
    this.setColouring(this.display.painter.next);
  }

  /** All stiffnesses of the organ times a factor, where that is exact: about a rest that is free of stress. */
  setStiffness(factor: number): void {
    if (!this.evaluator.notes.is_stress_free || !(factor > 0)) return;
    this.evaluator.factor = factor;
    this.tools.sayStiffness(factor);
    this.two.factor = factor;
    if (this.touching && !this.two.isPlaying) this.move(this.touching.motion);
    else this.show();
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
    const { outline } = this.display.body;
    outline.visible = !outline.visible;
    this.tools.press("outline", outline.visible);
    this.stage.invalidate();
  }

  /** Takes a probe into the hand, or puts it away; a touch goes on with it or without. Two hands keep what they hold. */
  toggleProbe(): void {
    const { two } = this;
    if (two.isPlaying) return;
    this.takeProbe(!two.hasProbe);
    if (this.touching && (this.activity === "held" || this.activity === "kept")) {
      const { point, displacement } = this.touching;
      this.touchAt(point, two.hasProbe);
      this.move(displacement);
    }
    this.show();
  }

  /** Into the hand, or out of it. */
  private takeProbe(hasProbe: boolean): void {
    this.two.hasProbe = this.display.arrow.hasProbe = hasProbe;
    this.tools.press("probe", hasProbe);
  }

  /** A contact that sticks moves over the organ by itself, or stops. */
  togglePath(): void {
    if (this.activity === "path") return this.rest();
    this.rest();
    if (!this.demonstration.beginPath()) return;
    this.takeProbe(false);
    this.activity = "path";
  }

  toggleModes(): void {
    if (this.activity === "modes") return this.rest();
    this.rest();
    this.activity = "modes";
    this.demonstration.beginModes();
  }

  stepMode(by: number): void {
    if (this.activity === "modes") this.demonstration.stepMode(by);
  }

  toggleTheme(): void {
    toggleTheme(this.plan.root);
    this.display.readings.redraw();
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
      ...(touching?.numbers(this.order) ?? NOBODY),
      looking: this.sight.looking,
      stiffness_factor: this.evaluator.factor,
      inside: this.display.shifts(touching, this.order),
      two: this.two.state,
      shapes: this.demonstration.shapes,
      frame: { rate: this.stage.pace.rate, answer: this.answering.value, drawing: this.stage.drawing.value },
    };
  }

  /** The touch, for whom it is told to. */
  get told(): Told {
    return this.two.told ?? (this.touching ? told(this.touching, this.order) : UNTOUCHED);
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
    this.share.dispose();
    this.pointer.dispose();
    this.two.dispose();
    this.demonstration.dispose();
    this.display.dispose();
    this.stage.dispose();
    this.evaluator.dispose();
    this.plan.remove();
  }

  /** Says in the header what else is to be known. */
  say(words: string): void {
    this.tools.say(words);
    this.announce(words);
  }

  announce(sentence: string): void {
    this.display.speech.summary.say(sentence);
  }

  /** The touch as one would say it, and what it is worth: the sentence below a picture. */
  caption(): string {
    const { touching, two, order } = this;
    if (two.isShown) return two.inWords.filter(Boolean).join(" ");
    return touching ? this.display.caption(touching, order, touching.worth(order)) : "";
  }

  /** What an address carries that shows this touch, seen like this. */
  hash(): string {
    return addressOf(this);
  }

  // How it is shown.

  private frame(seconds: number): void {
    if (this.activity === "springing") this.comeBack(seconds);
    else if (this.activity === "path") this.walkOn(seconds);
    else if (this.activity === "modes") this.demonstration.swing(seconds);
    if (this.two.advance()) this.stage.shape(() => this.shape());
    this.two.follow();
    this.sight.follow();
    this.hint.follow(this.activity === "rest");
    this.display.follow(this.touching, this.order, this.answering.value);
  }

  private comeBack(seconds: number): void {
    const left = this.spring.advance(seconds);
    if (left) this.move(left);
    else this.rest();
  }

  private walkOn(seconds: number): void {
    const { touching, displacement } = this.demonstration.walkOn(seconds, this.order);
    this.touching = touching;
    this.move(displacement);
  }

  private touchAt(point: Vec3, hasProbe = false): void {
    const { radius } = this.evaluator.about.metadata;
    this.touching = new TouchState(this.evaluator, point, this.display.body.normalAt(point, radius), hasProbe);
    this.touching.displace([0, 0, 0], this.order);
  }

  /** Ends what moved the organ by itself. */
  private stop(): void {
    this.two.end();
    this.demonstration.end();
    if (this.activity === "path" || this.activity === "modes") {
      this.activity = "rest";
      this.setColouring(this.display.painter.colouring);
    }
  }

  private show(): void {
    if (this.activity !== "modes") this.stage.shape(() => this.shape());
  }

  private shape(): void {
    if (this.two.isShown) this.two.show(this.order);
    else this.display.show(this.touching, this.order, this.activity !== "path");
    this.onTouch();
  }
}
