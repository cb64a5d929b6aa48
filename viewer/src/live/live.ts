// A case in real time: every frame is asked for, from this machine or a worker; one organ, or two laws side by side.
import * as THREE from "three";
import { lookOver, type Hit, type Surface } from "../stage/body";
import { Conversation } from "./conversation";
import { element, followTheme, toggleTheme, write } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { Gauge } from "../panels/gauge";
import { factsOf, surfaceOf, type Hello } from "./hello";
import { Hint } from "../panels/hint";
import { Holding } from "./holding";
import { listen, type Keyed } from "../hands/keys";
import { Legend } from "../panels/legend";
import type { Link, Others } from "./link";
import { colouringsOf, LivePainter, type LiveColouring } from "./colouring";
import { LiveReadings } from "./readings";
import { LiveTools } from "./tools";
import { Mean, paceInWords } from "../base/pace";
import { Plan } from "../panels/plan";
import { nudged, Pointer, type Reading, type Tool, type Touched, within } from "../hands/pointer";
import { Row } from "./row";
import type { Hand, Specimen } from "./specimen";
import { Share, type Shared } from "../panels/share";
import { Sight } from "../stage/sight";
import { Speech } from "../panels/speech";
import { Stage } from "../stage/stage";
import type { Told } from "../touch/told";
import { forces, trouble } from "./verdict";
import { headsetButton } from "../hands/xr";

/** Said by a view that shows hands of another one of the same organ. */
const ELSEWHERE = "The organ is held in another view. Take hold of it to go on here.";
/** A hand stays within this part of the organ's diagonal (live/src/stage.rs, python/viscera/viewer/stepped.py). */
const REACH = 0.5;

export class LiveView implements Touched, Keyed, Shared {
  /** Work after a frame has been shown. */
  onTouch: () => void = () => {};
  tool: Tool = "drag";
  readonly depth: number;
  readonly reach: number;
  readonly title: string;
  /** Work once the last hand has let go. */
  private onFree: () => void = () => {};
  /** Frames received, for programs. */
  frames = 0;
  /** Whether a frame has come that has not been drawn. */
  private isFresh = false;
  private readonly holding: Holding;
  /** Whether the stepper has gone, or an answer is overdue. */
  private isAway = false;
  /** The graphics processor that steps the organ, if one does. */
  private device: string | null;
  /** What the stepper refused, or why it has gone; it stands until a frame comes. */
  private complaint = "";
  /** Why a hand could not take hold; it stands until one takes hold again. */
  private refusal = "";
  private laws: string[];
  private readonly row: Row;
  private readonly conversation: Conversation;
  readonly surface: Surface;
  readonly stage: Stage;
  readonly sight: Sight;
  readonly share: Share;
  private readonly gauge: Gauge;
  private readonly hint: Hint;
  private readonly pointer: Pointer;
  private readonly deaf: (() => void)[];
  private readonly step = new Mean();
  private readonly plan: Plan;
  private readonly tools: LiveTools;
  private readonly readings: LiveReadings;
  private readonly labels = element("div");
  private readonly speech: Speech;
  private readonly clock = element("div", { class: "clock" });
  private readonly legend = new Legend();
  private readonly painter: LivePainter;

  constructor(
    place: HTMLElement,
    private readonly link: Link,
    private readonly hello: Hello,
    isEmbedded: boolean,
  ) {
    const surface = (this.surface = surfaceOf(hello));
    this.depth = 0.1 * hello.diagonal;
    this.reach = REACH * hello.diagonal;
    this.painter = new LivePainter(this.legend, this.depth, colouringsOf(hello));
    this.laws = [hello.law];
    this.device = hello.device ?? null;
    this.title = hello.name;
    this.conversation = new Conversation(link);
    this.holding = new Holding(this.conversation);
    this.plan = new Plan(hello.name, hello.is_still ? "Turn the view." : "Press on the organ to take hold of it.", isEmbedded);
    const { root } = this.plan;
    const { centre, facing } = lookOver(surface);
    this.stage = new Stage(this.plan.canvas, centre, hello.diagonal, hello.touchable ? facing : [0.2, -1, 0]);
    this.speech = new Speech(this.stage);
    this.gauge = new Gauge(this.stage, hello.axes);
    this.row = new Row(this.stage, surface, hello, this.labels, this.gauge.root);
    this.sight = new Sight(this.stage, () => this.specimens.map(({ body }) => body));
    this.share = new Share(this.stage, this, root);
    this.hint = new Hint(this.stage, () => this.pointer.near(this.row.middle));
    this.tools = new LiveTools(this, hello, factsOf(hello, link.place), headsetButton(this.stage, this.row, this));
    this.readings = new LiveReadings(hello.laws, (laws) => this.setLaws(laws));
    this.readings.root.hidden = hello.is_still ?? false;
    const side = element("div", { class: "side" }, this.readings.root, this.clock);
    this.plan.fill(
      place,
      [this.labels, this.hint.root],
      [this.stage.clearing, this.tools.header, this.speech.warning, this.gauge.root, this.legend.root, side, this.tools.root],
      [this.help, this.speech.summary.root],
    );
    this.arrange();
    this.pointer = new Pointer(this.stage, this.row, this);
    this.deaf = [listen(root, this), followTheme(root, () => {})];
    this.stage.onFrame = () => this.frame();
    this.conversation.onFrame = (numbers, others, isAnswer) => this.take(numbers, others, isAnswer);
    this.conversation.onComplaint = (sentence, refused) => this.complain(sentence, refused);
    this.conversation.onSilence = this.conversation.onEnd = (sentence) => this.lose(sentence);
    this.conversation.onNews = (sentence) => this.leaveDevice(sentence);
  }

  private get specimens(): Specimen[] {
    return this.row.specimens;
  }

  /** None of a solved state, nor where the stepper does not answer. */
  get hands(): number {
    return this.hello.is_still || this.isAway ? 0 : 2;
  }

  /** The first hand that holds the organ. */
  get held(): Hand | null {
    return this.holding.first;
  }

  get help(): HTMLDialogElement {
    return this.tools.help;
  }

  // What a hand does.

  grab(hit: Hit, hand = 0): void {
    if (this.hands === 0) return;
    this.hint.end();
    this.refusal = "";
    const { rest: point, organ: number } = hit;
    if (!this.held) this.begin();
    const organ = number === undefined ? undefined : this.hello.organs?.[number];
    const displacement = this.specimens[0]!.displacementAt(point, number);
    this.hold({ point, normal: this.row.normalAt(point, organ), displacement, organ }, hand);
  }

  private hold(held: Hand, hand: number): void {
    this.holding.take(held, hand);
    this.row.hide(this.holding.hands);
  }

  move(displacement: Vec3, hand = 0): void {
    // A hand that was taken over moves nothing until it takes hold anew.
    if (!this.holding.hands[hand] || this.holding.isMirror) return;
    this.holding.move(within(displacement, this.reach), hand);
    this.ask();
  }

  release(hand = 0): void {
    if (!this.holding.isMirror) this.letGo(hand);
  }

  private letGo(hand: number): void {
    if (!this.holding.hands[hand]) return;
    this.holding.release(hand);
    this.row.hide(this.holding.hands);
    if (!this.held) this.onFree();
  }

  /** Shows a touch that Python has made: a hand at a point [m] that has moved so far [m]. */
  watch(point: Vec3, displacement: Vec3): void {
    this.holding.mirror([{ point, displacement, normal: this.row.normalAt(point) }]);
    // Its force comes with the next frame.
    this.specimens.forEach((specimen) => specimen.lose());
  }

  /** Waits until no hand holds on. */
  free(): Promise<void> {
    return new Promise((done) => (this.held ? (this.onFree = done) : done()));
  }

  hover(hit: Hit | null): void {
    if (this.held) return;
    if (hit) this.row.hover(hit);
    else this.row.hide([null]);
    this.stage.invalidate();
  }

  contact(hand = 0): Hand | null {
    return this.holding.hands[hand] ?? null;
  }

  reading(hand = 0): Reading | null {
    return this.holding.hands[hand] ? this.specimens[0]!.reading(hand) : null;
  }

  // What tools, keys and programs do.

  /** One law, or two side by side; what a hand holds it goes on holding. */
  setLaws(laws: string[]): void {
    this.laws = laws;
    this.conversation.want({ laws });
    this.holding.hands.forEach((held, hand) => held && this.hold(held, hand));
    this.begin();
    this.arrange();
  }

  /** Begins anew, from rest and with nobody touching. */
  reset(): void {
    this.rest();
    this.conversation.forgetHands();
    if (this.painter.colouring === "stress") this.conversation.want({ stress: true });
    this.setLaws(this.laws);
    this.row.goHome();
  }

  setGravity(gravity: Vec3): void {
    this.conversation.want({ gravity });
  }

  setTool(tool: Tool): void {
    this.tool = this.tools.tool.value = tool;
  }

  /** Whether the wheel is meant for the view. */
  get isInUse(): boolean {
    return this.plan.isInUse;
  }

  /** A hand takes hold of the surface near a point and displaces it [m]. */
  touch(point: Vec3, displacement: Vec3, hand = 0): void {
    this.grab({ rest: point, moved: new THREE.Vector3(...point) }, hand);
    this.move(displacement, hand);
  }

  touchMiddle(): void {
    const hit = this.hands > 0 ? this.pointer.near(this.row.middle) : null;
    if (!hit) return;
    this.grab(hit);
    this.nudge(0, 0, 0.25);
  }

  nudge(right: number, up: number, inward: number): void {
    const hand = this.holding.hands.findIndex((found) => found !== null);
    if (hand < 0) return this.touchMiddle();
    const held = this.holding.hands[hand]!;
    if (this.holding.isMirror && this.hands > 0) this.hold(held, hand);
    const by = [right * this.depth, up * this.depth, inward * this.depth] as const;
    this.move(nudged(this.stage, held, by), hand);
  }

  rest(): void {
    this.refusal = "";
    this.holding.hands.forEach((_, hand) => this.letGo(hand));
    this.speak();
  }

  setColouring(colouring: LiveColouring): void {
    const [was, is] = [this.painter.colouring === "stress", colouring === "stress"];
    this.painter.colouring = this.tools.colouring.value = colouring;
    if (was !== is) this.conversation.want({ stress: is });
    this.stage.shape(() => this.show());
  }

  nextColouring(): void {
    this.setColouring(this.painter.next);
  }

  nextLook(): void {
    this.sight.next();
  }

  toggleOutline(): void {
    this.tools.hasOutline = !this.tools.hasOutline;
    this.specimens.forEach(({ body }) => (body.outline.visible = this.tools.hasOutline));
    this.stage.invalidate();
  }

  toggleProbe(): void {
    this.tools.hasProbe = !this.tools.hasProbe;
    this.specimens.forEach((specimen) => (specimen.hasProbe = this.tools.hasProbe));
    this.stage.shape(() => this.show());
  }

  toggleTheme(): void {
    toggleTheme(this.plan.root);
  }

  /** Makes the keys work. */
  focus(): void {
    this.plan.focus();
  }

  /** From where the organ is looked at [diagonals]. */
  get from(): Vec3 {
    return this.stage.camera.position.toArray();
  }

  /** Says in the header what is under way. */
  say(words: string): void {
    this.tools.say(words);
  }

  announce(sentence: string): void {
    this.speech.summary.say(sentence);
  }

  /** The sentence below a picture of the hand's forces. */
  caption(): string {
    return this.held ? forces(this.specimens, this.holding.hands, this.conversation.resting) : "";
  }

  /** The state in numbers, for programs: SI units. */
  state(): Record<string, unknown> {
    return {
      frames: this.frames,
      place: this.link.place,
      device: this.device,
      laws: this.laws,
      held: this.held,
      hands: this.holding.hands,
      colouring: this.painter.colouring,
      frame: { rate: this.stage.pace.rate, step: this.step.value, drawing: this.stage.drawing.value },
      specimens: this.specimens.map(({ facts, field, stress }) => ({ ...facts, field: Array.from(field), stress: Array.from(stress) })),
    };
  }

  /** Where a point of the first organ at rest [m] is on the canvas, in CSS pixels. */
  project(point: Vec3): { x: number; y: number } {
    return this.row.project(point);
  }

  // How it goes on.

  private frame(): void {
    this.sight.follow();
    this.gauge.follow();
    this.ask();
    if (this.isFresh) this.stage.shape(() => this.show());
    this.hint.follow(this.held === null && this.hands > 0 && this.row.hasSettled);
    this.specimens.forEach((specimen) => specimen.follow());
    const { pace, drawing } = this.stage;
    const times: [string, number][] = [
      ["step", this.step.value],
      ["drawing", drawing.value],
    ];
    write(this.clock, paceInWords(pace.rate, times));
  }

  /** Scales are those of what a hand does from now on. */
  private begin(): void {
    this.row.begin();
    this.painter.begin();
  }

  /** Asks for a frame where something is wanted or moves. */
  private ask(): void {
    this.holding.ask(this.specimens.some(({ isMoving }) => isMoving));
  }

  private take(numbers: Float32Array, others: Others | null, isAnswer: boolean): void {
    if (!this.row.take(numbers)) return;
    this.frames += 1;
    this.holding.note(others, isAnswer, (point, organ) => this.row.normalAt(point, organ));
    this.row.hide(this.holding.hands);
    this.step.add(this.row.milliseconds);
    this.conversation.slowest = Math.max(this.conversation.slowest, this.row.milliseconds);
    [this.isAway, this.complaint] = [false, ""];
    this.isFresh = true;
    this.stage.invalidate();
    // An organ on its way, or a hand that has moved, does not wait for the drawing.
    if (this.specimens.some(({ facts }) => !facts.isSettled) || this.conversation.hasWishes) this.ask();
  }

  /** The touch, for whom it is told to; null where another view tells of it. */
  get told(): Told | null {
    return this.holding.told(this.specimens[0]!);
  }

  private show(): void {
    this.isFresh = false;
    const { specimens } = this;
    this.row.present(this.held !== null);
    if (this.held) this.row.hold(this.holding.hands);
    this.painter.show(specimens);
    this.readings.show(specimens);
    this.onTouch();
    this.speak();
  }

  /** Says how things stand, and what is the matter. */
  private speak(): void {
    const matter = this.holding.isElsewhere ? ELSEWHERE : trouble(this.specimens, this.holding.hands, this.conversation.resting);
    this.speech.say(this.caption(), this.complaint || this.refusal || matter);
  }

  /** The graphics processor is gone, and the processor steps the organ from where it was. */
  private leaveDevice(why: string): void {
    this.device = null;
    const sentence = `${why}; the processor goes on`;
    this.say(sentence);
    this.announce(sentence);
  }

  /** The stepper has gone, or is silent: nothing can be taken hold of, and the last force is no settled one. */
  private lose(sentence: string): void {
    this.isAway = true;
    this.complaint = sentence;
    this.specimens.forEach((specimen) => specimen.lose());
    this.stage.shape(() => this.show());
  }

  /** A request was refused: hands that were to take hold in it have not. */
  private complain(sentence: string, refused: readonly number[]): void {
    [this.isAway, this.complaint] = [false, ""];
    refused.forEach((hand) => this.letGo(hand));
    if (refused.length > 0) this.refusal = sentence;
    else this.complaint = sentence;
    this.speak();
  }

  /** Makes the organs anew, one for each law, side by side. */
  private arrange(): void {
    const choose = (index: number, law: string) => this.setLaws(this.laws.map((old, k) => (k === index ? law : old)));
    this.row.arrange(this.laws, this.tools, choose);
    this.sight.renew();
    this.readings.arrange(this.specimens);
    this.stage.invalidate();
  }

  dispose(): void {
    this.deaf.forEach((end) => end());
    this.conversation.end();
    this.speech.dispose();
    this.share.dispose();
    this.pointer.dispose();
    this.specimens.forEach((specimen) => specimen.dispose());
    this.stage.dispose();
    this.plan.remove();
  }
}
