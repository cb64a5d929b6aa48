// Two hands on a reduced model: who answers them, and where what is read off stands.
import type { Body, Hit } from "../stage/body";
import type { Display } from "./display";
import { element } from "../base/dom";
import { Duet } from "./duet";
import type { Evaluator, Vec3 } from "../model/evaluator";
import type { Reading } from "../hands/pointer";
import { ProbePair } from "./probepair";
import type { Stage } from "../stage/stage";
import type { Told } from "../touch/told";
import { TouchState } from "../touch/touchstate";

export class TwoHands {
  /** Whether hands hold probes: then the model answers both. Else its organ is stepped, where there is a case of it. */
  hasProbe = false;
  /** The readings, and the numbers beside the arrows. */
  readonly readings = element("div");
  readonly labels = element("div");
  private readonly pair: ProbePair;
  /** Null until it is there. */
  private duet: Duet | null = null;
  /** Done once it is there, or cannot be; null until it has been asked for. */
  private expected: Promise<void> | null = null;

  constructor(
    private readonly evaluator: Evaluator,
    private readonly stage: Stage,
    private readonly display: Display,
    /** A case of the same organ. */
    private readonly caseUrl: string | null,
    /** Work when there is another body. */
    private readonly changed: () => void,
  ) {
    this.pair = new ProbePair(evaluator, stage, display, this);
  }

  /** How many hands may touch at once. */
  get count(): number {
    return this.hasProbe || this.duet ? 2 : 1;
  }

  /** Loads what answers two hands without probes, where a second one may come. */
  expect(): Promise<void> {
    if (this.caseUrl === null || this.hasProbe) return Promise.resolve();
    this.expected ??= this.prepare(this.caseUrl);
    return this.expected;
  }

  private prepare(caseUrl: string): Promise<void> {
    const enter = (duet: Duet) => {
      this.readings.append(duet.root);
      duet.factor = this.evaluator.factor;
      this.duet = duet;
      this.changed();
    };
    // Where it cannot be loaded, one hand touches as before.
    return Duet.prepare(this.stage, this.display, this.labels, caseUrl).then(enter, (error: unknown) => console.info(error));
  }

  /** Whether two hands have taken hold, and the model alone does not answer yet. */
  get isPlaying(): boolean {
    return this.playing !== null;
  }

  /** Whether what answers them is seen. */
  get isShown(): boolean {
    return this.pair.isPlaying || this.duet?.isShown === true;
  }

  /** All that may be seen. */
  get bodies(): readonly Body[] {
    return this.duet ? [this.display.body, this.duet.body] : [this.display.body];
  }

  /** The body that is seen. */
  get body(): Body {
    return this.duet?.isShown ? this.duet.body : this.display.body;
  }

  /** All stiffnesses of the organ, in units of its own. */
  set factor(factor: number) {
    if (this.duet) this.duet.factor = factor;
    if (this.pair.isPlaying) this.pair.renew();
  }

  /** A hand takes hold beside the one that touches already. */
  join(touching: TouchState, owner: number, hit: Hit, hand: number): void {
    if (touching.felt && this.duet?.isPlaying !== true) this.pair.join(touching, hit, hand);
    else this.duet?.join(touching, owner, hit, hand);
  }

  /** Whether there is something new to be shown at once. */
  move(displacement: Vec3, hand: number): boolean {
    this.playing?.move(displacement, hand);
    return this.pair.isPlaying;
  }

  contact(hand: number): { normal: Vec3; displacement: Vec3 } | null {
    return this.playing?.contact(hand) ?? null;
  }

  reading(hand: number): Reading | null {
    return this.playing?.reading(hand) ?? null;
  }

  /** A hand lets go: whether the other one holds on, and the touch, in the field of an order, if the model answers it again. */
  leave(hand: number, order: number): { isHeld: boolean; touching: TouchState | null } {
    if (this.pair.isPlaying) return { isHeld: true, touching: this.pair.leave(hand, order) };
    const last = this.duet!.leave(hand);
    if (!last) return { isHeld: true, touching: null };
    const touching = new TouchState(this.evaluator, last.point, last.normal);
    touching.displace(last.displacement, order);
    return { isHeld: false, touching };
  }

  /** Leaves the stage to the model. */
  end(): void {
    this.playing?.end();
  }

  /** Asks for what comes next; says whether there is something new to be shown. */
  advance(): boolean {
    return this.duet?.advance() === true;
  }

  /** Shows what they do, in the field of an order where the model answers. */
  show(order: number): void {
    if (this.pair.isPlaying) this.pair.show(order);
    else this.duet?.show();
    this.display.speech.say(...this.inWords);
  }

  /** Keeps up with the camera. */
  follow(): void {
    this.playing?.follow();
  }

  /** The forces in words, and what is the matter. */
  get inWords(): [string, string] {
    return this.playing?.inWords ?? ["", ""];
  }

  /** Its part of the state in numbers: SI units. */
  get state(): Record<string, unknown> | null {
    return this.playing?.state ?? null;
  }

  /** What the first hand does, to whom it is told; null where that is not seen. */
  get told(): Told | null {
    return this.isShown ? this.playing!.told : null;
  }

  dispose(): void {
    this.pair.dispose();
    this.duet?.dispose();
  }

  private get playing(): Duet | ProbePair | null {
    if (this.pair.isPlaying) return this.pair;
    return this.duet?.isPlaying ? this.duet : null;
  }
}
