// Two hands on a reduced model, which knows one contact: while both hold on, its organ is stepped by a worker of the page.
import type { Body, Hit } from "../stage/body";
import type { Painter } from "./colouring";
import { Conversation } from "../live/conversation";
import { introduction } from "../live/hello";
import type { Display } from "./display";
import { digits, element, write } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { load } from "../model/files";
import { lawName } from "../model/lawname";
import { WorkerLink, type Link } from "../live/link";
import type { Reading } from "../hands/pointer";
import { indices } from "../model/safetensors";
import { Holding } from "../live/holding";
import { Specimen, type Hand } from "../live/specimen";
import type { Stage } from "../stage/stage";
import type { Told } from "../touch/told";
import type { TouchState } from "../touch/touchstate";
import { forces, trouble } from "../live/verdict";

const WORDS =
  "With two hands the organ itself is stepped, without orders and without an estimated error; the reduced model has one contact.";
/** Frames after which the stepped organ is shown even if it has not settled. */
const PATIENCE = 20;

export class Duet {
  /** Whether two hands have taken hold, and not yet all let go. */
  isPlaying = false;
  /** Whether the stepped organ is seen: once it has come to where the first hand was. */
  isShown = false;
  /** Why it cannot go on; empty while it can. */
  private complaint = "";
  /** Why the hand that joined could not take hold; it stands until one joins again. */
  private refusal = "";
  /** The hand that joined last. */
  private joined = 0;
  private readonly holding: Holding;
  /** What the forces of a frame are multiplied by. */
  private times = 1;
  /** What is read off, in the place of the model's readings. */
  readonly root: HTMLElement;
  private readonly conversation: Conversation;
  private frames = 0;
  private isFresh = false;
  /** The largest force of this grip [N]: the longest arrow. */
  private peak = 0;

  /** Loads a case of the model's organ, and what steps it. */
  static async prepare(stage: Stage, display: Display, labels: HTMLElement, caseUrl: string): Promise<Duet> {
    const bytes = await load(caseUrl, () => {});
    const touchable = Uint32Array.from(indices(bytes, "touchable"));
    const link = new WorkerLink(bytes.buffer);
    try {
      const hello = await introduction(link);
      const [rest, triangles] = [Float32Array.from(hello.rest), Uint32Array.from(hello.triangles)];
      const surface = { rest, triangles, touchable, diagonal: hello.diagonal };
      const own: [string, string] = [hello.law, lawName(hello.law)];
      const specimen = new Specimen(surface, hello.radius, stage, display.gauge.root, [own], hello.law, "", () => {});
      labels.append(...specimen.grips.map(({ label }) => label.root));
      return new Duet(stage, display, link, specimen, hello.radius, display.painter.beside(surface, specimen.body));
    } catch (error) {
      link.close();
      throw error;
    }
  }

  private constructor(
    private readonly stage: Stage,
    private readonly display: Display,
    link: Link,
    readonly specimen: Specimen,
    private readonly radius: number,
    private readonly painter: Painter,
  ) {
    this.conversation = new Conversation(link);
    this.holding = new Holding(this.conversation);
    this.conversation.onFrame = (numbers) => this.take(numbers);
    this.conversation.onComplaint = (sentence, refused) => this.complain(sentence, refused);
    this.conversation.onSilence = this.conversation.onEnd = (sentence) => this.lose(sentence);
    specimen.place.visible = false;
    stage.world.add(specimen.place);
    const words = element("p", {}, WORDS);
    this.conversation.onNews = (sentence) => write(words, `${WORDS} Now ${sentence}; the processor goes on.`);
    this.root = element("section", { class: "panel readings live", "aria-label": "two hands" }, specimen.root, words);
    this.root.hidden = true;
  }

  get body(): Body {
    return this.specimen.body;
  }

  /** A second hand joins the one that touches the model: from now on the organ is stepped, from rest. */
  join(touching: TouchState, owner: number, hit: Hit, hand: number): void {
    if (!this.isPlaying) {
      const { point, normal, displacement } = touching;
      this.isPlaying = true;
      this.isShown = this.isFresh = this.specimen.hasSettled = false;
      this.frames = this.peak = 0;
      this.conversation.forgetHands();
      this.conversation.want({ laws: [this.specimen.law] });
      this.grab({ point, normal, displacement }, owner);
    }
    [this.joined, this.refusal] = [hand, ""];
    const displacement = (this.isShown ? this.specimen : touching).displacementAt(hit.rest);
    this.grab({ point: hit.rest, normal: this.body.normalAt(hit.rest, this.radius), displacement }, hand);
  }

  /** Moves a hand to a displacement from where it took hold [m]. */
  move(displacement: Vec3, hand: number): void {
    if (!this.holding.hands[hand]) return;
    this.holding.move(displacement, hand);
    this.ask();
  }

  /** Outward normal where a hand took hold, and how far it has moved. */
  contact(hand: number): Hand | null {
    return this.holding.hands[hand] ?? null;
  }

  /** A hand lets go. What it held if it was the last one: then the stage is the model's again. */
  leave(hand: number): Hand | null {
    const held = this.holding.hands[hand]!;
    this.release(hand);
    if (this.holding.first) return null;
    this.end();
    return held;
  }

  /** Leaves the stage to the model. */
  end(): void {
    this.holding.hands.forEach((held, hand) => held && this.release(hand));
    this.isPlaying = this.isShown = this.specimen.place.visible = this.display.isAway = false;
    this.root.hidden = true;
    this.follow();
  }

  /** What is told beside the force of a hand; null until it is known. */
  reading(hand: number): Reading | null {
    return this.isShown && this.holding.hands[hand] ? this.specimen.reading(hand) : null;
  }

  /** Asks for the next frame; says whether there is a new one to be shown. */
  advance(): boolean {
    if (this.isPlaying) this.ask();
    return this.isShown && this.isFresh;
  }

  /** Shapes the organ as the last frame says. */
  show(): void {
    const { specimen } = this;
    this.isFresh = false;
    specimen.present();
    const { sizes, facts } = specimen;
    // A force on its way may be of any size: it does not set the scale.
    if (facts.isSettled) this.peak = Math.max(this.peak, ...sizes);
    specimen.hold(this.holding.hands, this.peak || Math.max(...sizes));
    this.painter.colouring = this.display.painter.colouring;
    this.painter.show(specimen, 0);
  }

  /** Writes the forces beside their arrows. */
  follow(): void {
    this.specimen.follow();
  }

  /** All stiffnesses of the organ, in units of its own. */
  get factor(): number {
    return this.times;
  }

  /** An organ that has settled sends no further forces: those that are there change too. */
  set factor(factor: number) {
    this.scale(factor / this.times);
    this.peak *= factor / this.times;
    this.times = factor;
    this.isFresh = true;
    this.stage.invalidate();
  }

  private scale(by: number): void {
    const { force, second } = this.specimen.facts;
    for (const each of [force, second]) each.forEach((f, i) => (each[i] = by * f));
  }

  /** The forces in words, and what is the matter. */
  get inWords(): [string, string] {
    const stiffness = this.factor === 1 ? "" : ` Stiffness × ${digits(this.factor, 2)}.`;
    const { resting } = this.conversation;
    const matter = this.complaint || this.refusal || trouble([this.specimen], this.holding.hands, resting);
    return [`${forces([this.specimen], this.holding.hands, resting)}${stiffness}`, matter];
  }

  /** Its part of the state in numbers: SI units. */
  get state(): Record<string, unknown> {
    const { facts, field } = this.specimen;
    return { hands: this.holding.hands, ...facts, field: Array.from(field) };
  }

  /** What the first hand that holds on does, to whom it is told. */
  get told(): Told | null {
    return this.holding.told(this.specimen);
  }

  dispose(): void {
    this.conversation.end();
    this.stage.world.remove(this.specimen.place);
    this.specimen.dispose();
    this.root.remove();
  }

  private grab(held: Hand, hand: number): void {
    this.holding.take(held, hand);
    this.ask();
  }

  private release(hand: number): void {
    this.holding.release(hand);
    this.specimen.letGo(hand);
    this.ask();
  }

  /** A hand that joined could not take hold: the other one holds on alone. */
  private complain(sentence: string, refused: readonly number[]): void {
    const { joined, isPlaying } = this;
    if (refused.length === 0) this.complaint = sentence;
    if (!isPlaying) return;
    if (refused.length > 0) {
      this.refusal = sentence;
      this.release(joined);
      const held = this.holding.hands[1 - joined];
      if (held) this.grab(held, 1 - joined);
    }
    this.display.speech.say(...this.inWords);
  }

  /** The stepper has gone: the last forces are no settled ones. */
  private lose(sentence: string): void {
    this.complaint = sentence;
    this.specimen.lose();
    this.isFresh = true;
    this.stage.invalidate();
    if (this.isPlaying) this.display.speech.say(...this.inWords);
  }

  private ask(): void {
    this.holding.ask(this.specimen.isMoving);
  }

  private take(numbers: Float32Array): void {
    this.specimen.take(numbers.subarray(1));
    this.holding.note(null, true, () => [0, 0, 0]);
    this.scale(this.times);
    this.frames += 1;
    this.complaint = "";
    this.isFresh = true;
    this.stage.invalidate();
    if (!this.isPlaying) return;
    if (!this.isShown && (this.specimen.facts.isSettled || this.frames > PATIENCE)) {
      this.isShown = this.specimen.place.visible = true;
      this.root.hidden = false;
      this.display.isAway = true;
    }
    // An organ on its way, or a hand that has moved, does not wait for the drawing.
    if (!this.specimen.facts.isSettled || this.conversation.hasWishes) this.ask();
  }
}
