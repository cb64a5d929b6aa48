// The two hands on what is stepped: what each of them holds, whose they are, and what the last frame knew of them.
import type { Conversation } from "./conversation";
import type { Others } from "./link";
import type { Hand, Specimen } from "./specimen";
import type { Vec3 } from "../model/evaluator";
import { UNTOUCHED, type Told } from "../touch/told";

/** The outward normal at a point at rest, of an organ of a scene that is named. */
type NormalOf = (point: Vec3, organ?: string) => Vec3;

export class Holding {
  readonly hands: [Hand | null, Hand | null] = [null, null];
  /** Whether they are Python's or those of another view, which this one only shows. */
  isMirror = false;
  /** Whether another view holds the organ. */
  isElsewhere = false;
  /** The hands as the last request told of them, and as the last frame answers them. */
  private asked: readonly (Hand | null)[] = [null, null];
  private answered: readonly (Hand | null)[] = [null, null];

  constructor(private readonly conversation: Conversation) {}

  /** The first hand that holds on. */
  get first(): Hand | null {
    return this.hands[0] ?? this.hands[1];
  }

  /** A hand takes hold; who takes the organ from another view takes it from both of its hands. */
  take(held: Hand, hand: number): void {
    if (this.isElsewhere) this.hands[1 - hand] = null;
    this.isMirror = this.isElsewhere = false;
    this.hands[hand] = held;
    this.conversation.gesture(hand, { grab: held.point, organ: held.organ, move: held.displacement });
  }

  /** A hand moves to a displacement from where it took hold [m]. */
  move(displacement: Vec3, hand: number): void {
    this.hands[hand]!.displacement = displacement;
    this.conversation.gesture(hand, { move: displacement });
  }

  release(hand: number): void {
    this.hands[hand] = null;
    this.conversation.gesture(hand, { release: true });
  }

  /** Asks for a frame where something is wanted or moves. */
  ask(isMoving: boolean): void {
    if (this.conversation.ask(isMoving)) this.asked = copied(this.hands);
  }

  /** Takes note of a frame: it answers what was asked, or shows hands that are not this view's. */
  note(others: Others | null, isAnswer: boolean, normalOf: NormalOf): void {
    if (!others && isAnswer) this.answered = this.asked;
    if (!others || this.conversation.isActing) return;
    this.mirror(others.hands.map((told, hand) => told && this.shown(told, hand, normalOf)));
    this.isElsewhere = others.isElsewhere;
    this.answered = copied(this.hands);
  }

  /** Shows hands that are not this view's. */
  mirror(hands: readonly (Hand | null)[]): void {
    this.isMirror = true;
    hands.forEach((held, hand) => (this.hands[hand] = held));
  }

  /**
   * The touch of the first hand that holds on, for whom it is told to: displacement and force are of one frame. Before one
   * has come of what it holds there is no force; null where another view tells of the touch.
   */
  told(specimen: Specimen): Told | null {
    if (this.isElsewhere) return null;
    const hand = this.hands.findIndex((held) => held !== null);
    const [held, then] = [this.hands[hand], this.answered[hand]];
    if (!held) return UNTOUCHED;
    if (then?.point === held.point) return specimen.told(then, hand);
    return { point: held.point, displacement: held.displacement, force: null, is_trusted: false };
  }

  /** Where it has taken hold, and the normal there, remain what they are. */
  private shown(told: Omit<Hand, "normal">, hand: number, normalOf: NormalOf): Hand {
    const held = this.hands[hand];
    const isSame = held?.point.every((x, i) => x === told.point[i]);
    return isSame ? { ...held!, ...told, point: held!.point } : { ...told, normal: normalOf(told.point, told.organ) };
  }
}

function copied(hands: readonly (Hand | null)[]): (Hand | null)[] {
  return hands.map((held) => held && { ...held });
}
