// A case in real time: every frame is asked for, from this machine or a worker; one organ, or two laws side by side.
import * as THREE from "three";
import { lookOver, type Hit, type Surface } from "../stage/body";
import { Conversation, factsOf, type Hello } from "./conversation";
import { element, followTheme, toggleTheme } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { Gauge } from "../panels/gauge";
import { Hint } from "../panels/hint";
import { listen, type Keyed } from "../hands/keys";
import { Legend } from "../panels/legend";
import type { Link } from "./link";
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
import { UNTOUCHED, type Told } from "../touch/told";
import { forces, trouble } from "./verdict";
import { headsetButton } from "../hands/xr";

/** Below this residual, with nothing new wanted, no more frames are asked for. */
const AT_REST = 1e-8;
/** A hand stays within this part of the organ's diagonal (live/src/stage.rs, python/viscera/viewer/stepped.py). */
const REACH = 0.5;

export class LiveView implements Touched, Keyed, Shared {
  /** None of a solved state, nor once the stepper has gone. */
  hands: number;
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
  private readonly holding: [Hand | null, Hand | null] = [null, null];
  /** The graphics processor that steps the organ, if one does. */
  private device: string | null;
  /** What the stepper refused, or why it has gone; it stands until a frame comes. */
  private complaint = "";
  /** Why a hand could not take hold; it stands until one takes hold again. */
  private refusal = "";
  private laws: string[];
  private readonly row: Row;
  private readonly conversation: Conversation;
  private readonly surface: Surface;
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
    this.surface = {
      rest: Float32Array.from(hello.rest),
      triangles: Uint32Array.from(hello.triangles),
      touchable: Uint32Array.from(hello.touchable ?? hello.triangles),
      diagonal: hello.diagonal,
      organOf: hello.organ_of,
      around: { bodies: hello.bodies ?? [], springs: hello.springs ?? 0 },
    };
    this.depth = 0.1 * hello.diagonal;
    this.reach = REACH * hello.diagonal;
    this.painter = new LivePainter(this.legend, this.depth, colouringsOf(hello));
    this.laws = [hello.law];
    this.device = hello.device ?? null;
    this.title = hello.name;
    this.hands = hello.is_still ? 0 : 2;
    this.plan = new Plan(hello.name, hello.is_still ? "Turn the view." : "Press on the organ to take hold of it.", isEmbedded);
    const { root } = this.plan;
    const { centre, facing } = lookOver(this.surface);
    this.stage = new Stage(this.plan.canvas, centre, hello.diagonal, hello.touchable ? facing : [0.2, -1, 0]);
    this.speech = new Speech(this.stage);
    this.gauge = new Gauge(this.stage);
    this.row = new Row(this.stage, this.surface, hello.radius, hello.laws, this.labels, this.gauge.root);
    this.sight = new Sight(this.stage, () => this.specimens.map(({ body }) => body));
    this.share = new Share(this.stage, this, root);
    this.hint = new Hint(this.stage, () => this.pointer.near(this.middle));
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
    this.conversation = new Conversation(link);
    this.conversation.onFrame = (numbers) => this.take(numbers);
    this.conversation.onComplaint = (sentence, refused) => this.complain(sentence, refused);
    this.conversation.onEnd = (sentence) => this.lose(sentence);
    this.conversation.onNews = (sentence) => this.leaveDevice(sentence);
  }

  private get specimens(): Specimen[] {
    return this.row.specimens;
  }

  /** The first hand that holds the organ. */
  get held(): Hand | null {
    return this.holding[0] ?? this.holding[1];
  }

  get help(): HTMLDialogElement {
    return this.tools.help;
  }

  // What a hand does.

  grab(hit: Hit, hand = 0): void {
    if (this.hands === 0) return;
    this.hint.end();
    this.refusal = "";
    const first = this.specimens[0]!;
    const { rest: point, organ } = hit;
    if (!this.held) this.begin();
    const normal = first.body.normalAt(point, this.hello.radius, organ);
    const displacement = first.displacementAt(point, organ);
    this.hold({ point, normal, displacement, organ: organ === undefined ? undefined : this.hello.organs?.[organ] }, hand);
  }

  private hold(held: Hand, hand: number): void {
    this.holding[hand] = held;
    this.conversation.gesture(hand, { grab: held.point, organ: held.organ, move: held.displacement });
  }

  move(displacement: Vec3, hand = 0): void {
    const held = this.holding[hand];
    if (!held) return;
    held.displacement = within(displacement, this.reach);
    this.conversation.gesture(hand, { move: held.displacement });
    this.ask();
  }

  release(hand = 0): void {
    if (!this.holding[hand]) return;
    this.holding[hand] = null;
    this.specimens.forEach((specimen) => specimen.letGo(hand));
    this.conversation.gesture(hand, { release: true });
    if (!this.held) this.onFree();
  }

  /** Waits until no hand holds on. */
  free(): Promise<void> {
    return new Promise((done) => (this.held ? (this.onFree = done) : done()));
  }

  hover(hit: Hit | null): void {
    if (this.held) return;
    const normal = hit && this.specimens[0]!.body.normalAt(hit.rest, this.hello.radius, hit.organ);
    for (const specimen of this.specimens) {
      if (hit) specimen.hover(hit.rest, normal!, hit.organ);
      else specimen.letGo(0);
    }
    this.stage.invalidate();
  }

  contact(hand = 0): Hand | null {
    return this.holding[hand] ?? null;
  }

  reading(hand = 0): Reading | null {
    return this.holding[hand] ? this.specimens[0]!.reading(hand) : null;
  }

  // What tools, keys and programs do.

  /** One law, or two side by side; what a hand holds it goes on holding. */
  setLaws(laws: string[]): void {
    this.laws = laws;
    this.conversation.want({ laws });
    this.holding.forEach((held, hand) => held && this.hold(held, hand));
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
    const hit = this.hands > 0 ? this.pointer.near(this.middle) : null;
    if (!hit) return;
    this.grab(hit);
    this.nudge(0, 0, 0.25);
  }

  nudge(right: number, up: number, inward: number): void {
    const hand = this.holding.findIndex((found) => found !== null);
    if (hand < 0) return this.touchMiddle();
    const by = [right * this.depth, up * this.depth, inward * this.depth] as const;
    this.move(nudged(this.stage, this.holding[hand]!, by), hand);
  }

  rest(): void {
    this.refusal = "";
    this.holding.forEach((_, hand) => this.release(hand));
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
    return this.held ? forces(this.specimens, this.holding) : "";
  }

  /** The state in numbers, for programs: SI units. */
  state(): Record<string, unknown> {
    return {
      frames: this.frames,
      place: this.link.place,
      device: this.device,
      laws: this.laws,
      held: this.held,
      hands: this.holding,
      colouring: this.painter.colouring,
      frame: { rate: this.stage.pace.rate, step: this.step.value, drawing: this.stage.drawing.value },
      specimens: this.specimens.map(({ facts, field, stress }) => ({ ...facts, field: Array.from(field), stress: Array.from(stress) })),
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
    this.ask();
    if (this.isFresh) this.stage.shape(() => this.show());
    this.hint.follow(this.held === null && this.hands > 0 && this.row.hasSettled);
    this.specimens.forEach((specimen) => specimen.follow());
    const { pace, drawing } = this.stage;
    this.clock.textContent = paceInWords(pace.rate, [
      ["step", this.step.value],
      ["drawing", drawing.value],
    ]);
  }

  /** Scales are those of what a hand does from now on. */
  private begin(): void {
    this.row.begin();
    this.painter.begin();
  }

  /** Asks for a frame where something is wanted or moves. */
  private ask(): void {
    this.conversation.ask(this.specimens.some(({ facts }) => facts.residual > AT_REST || facts.taken < 1 || !facts.isSettled));
  }

  private take(numbers: Float32Array): void {
    // A frame that was under way when the laws changed is of another number of organs.
    if (numbers[0] !== this.specimens.length) return;
    const size = (numbers.length - 1) / this.specimens.length;
    this.frames += 1;
    this.specimens.forEach((specimen, k) => specimen.take(numbers.subarray(1 + k * size, 1 + (k + 1) * size)));
    this.step.add(this.specimens.reduce((sum, { facts }) => sum + facts.milliseconds, 0));
    this.complaint = "";
    this.isFresh = true;
    this.stage.invalidate();
    // An organ on its way, or a hand that has moved, does not wait for the drawing.
    if (this.specimens.some(({ facts }) => !facts.isSettled) || this.conversation.hasWishes) this.ask();
  }

  /** The touch of the first hand that holds on, for whom it is told to. */
  get told(): Told {
    const { held } = this;
    if (!held) return UNTOUCHED;
    const { force, second, isSettled } = this.specimens[0]!.facts;
    const own = held === this.holding[0] ? force : second;
    return { point: held.point, displacement: held.displacement, force: own, is_trusted: isSettled };
  }

  private show(): void {
    this.isFresh = false;
    const { specimens } = this;
    this.row.present(this.held !== null);
    if (this.held) this.row.hold(this.holding);
    this.painter.show(specimens);
    this.readings.show(specimens);
    this.onTouch();
    this.speak();
  }

  /** Says how things stand, and what is the matter. */
  private speak(): void {
    this.speech.say(this.caption(), this.complaint || this.refusal || trouble(this.specimens, this.holding));
  }

  /** The graphics processor is gone, and the processor steps the organ from where it was. */
  private leaveDevice(why: string): void {
    this.device = null;
    const sentence = `${why}; the processor goes on`;
    this.say(sentence);
    this.announce(sentence);
  }

  /** The stepper has gone: nothing can be taken hold of, and the last force is no settled one. */
  private lose(sentence: string): void {
    this.hands = 0;
    this.complaint = sentence;
    this.specimens.forEach((specimen) => specimen.lose());
    this.stage.shape(() => this.show());
  }

  /** A request was refused: hands that were to take hold in it have not. */
  private complain(sentence: string, refused: readonly number[]): void {
    refused.forEach((hand) => this.release(hand));
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
    this.link.close();
    this.speech.dispose();
    this.share.dispose();
    this.pointer.dispose();
    this.specimens.forEach((specimen) => specimen.dispose());
    this.stage.dispose();
    this.plan.remove();
  }
}
