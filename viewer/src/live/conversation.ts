// What is said between a view and its stepper: one request at a time, the wishes of a moment gathered in it, frames back.
import type { Vec3 } from "../model/evaluator";
import type { Link, Others } from "./link";

/** What a hand does (live/src/request.rs). */
export interface Gesture {
  grab?: Vec3;
  /** Of a scene, the name of the organ that it takes hold of. */
  organ?: string;
  move?: Vec3;
  release?: true;
}

type Request = Gesture & { laws?: string[]; gravity?: Vec3; stress?: boolean; second?: Gesture };

/** A request is overdue after this [ms], or after so many times what a frame takes, if that is longer. */
const PATIENCE = 5000;
const FRAMES = 10;

export class Conversation {
  /** Of a frame that has come: its numbers; the hands that are not this view's; whether it answers this view. */
  onFrame: (numbers: Float32Array, others: Others | null, isAnswer: boolean) => void = () => {};
  /** What the stepper refused; and the hands that were to take hold by what it refused. */
  onComplaint: (sentence: string, refused: readonly number[]) => void = () => {};
  /** An answer is overdue; the sentence says so. It may come all the same. */
  onSilence: (sentence: string) => void = () => {};
  /** Why the stepper has gone: no frame comes any more. */
  onEnd: (sentence: string) => void = () => {};
  /** What a frame brings in words: why it is stepped another way from now on. */
  onNews: (sentence: string) => void = () => {};
  /** Whether an answer is under way. */
  isWaiting = false;
  /** What the slowest frame so far has taken [ms]. */
  slowest = 0;
  /** Frames since anything was last wanted: so long hands have been at rest. */
  resting = 0;
  private alarm = 0;
  private wanted: Request = {};
  /** The last request. */
  private asked: Request = {};

  constructor(private readonly link: Link) {
    link.onMessage = (data, others = null, isAnswer = true) => this.receive(data, others, isAnswer);
    link.onClose = (sentence) => {
      clearTimeout(this.alarm);
      this.onEnd(sentence);
    };
  }

  /** Nothing is asked for any more. */
  end(): void {
    clearTimeout(this.alarm);
    this.link.close();
  }

  /** Whether something is wanted that has not been asked for. */
  get hasWishes(): boolean {
    return Object.keys(this.wanted).length > 0;
  }

  /** Whether a hand takes hold or lets go, or the organ begins anew, by what no answer has come to. */
  get isActing(): boolean {
    const requests = this.isWaiting ? [this.wanted, this.asked] : [this.wanted];
    const acts = ({ grab, release, laws, second }: Request): boolean => Boolean(grab || release || laws || (second && acts(second)));
    return requests.some(acts);
  }

  /** Adds to what the next request asks for. */
  want(wish: Omit<Request, keyof Gesture | "second">): void {
    Object.assign(this.wanted, wish);
  }

  /** Adds what a hand does; who takes hold has not let go any more, and the other way round. */
  gesture(hand: number, wish: Gesture): void {
    const said: Gesture = hand === 0 ? this.wanted : (this.wanted.second ??= {});
    if (wish.grab) delete said.release;
    if (wish.release) {
      delete said.grab;
      delete said.organ;
      delete said.move;
    }
    Object.assign(said, wish);
  }

  /** Forgets what hands were to do, and nothing else that was wanted. */
  forgetHands(): void {
    const { grab, organ, move, release, second, ...others } = this.wanted;
    this.wanted = others;
  }

  /** Asks for a frame where something is wanted or moves; one at a time. Says whether it has. */
  ask(isMoving: boolean): boolean {
    if (this.isWaiting || !this.link.isOpen || !(isMoving || this.hasWishes)) return false;
    if (this.hasWishes) this.resting = 0;
    this.link.send(JSON.stringify(this.wanted));
    this.asked = this.wanted;
    this.wanted = {};
    this.isWaiting = true;
    this.alarm = setTimeout(() => this.onSilence(this.link.silence), Math.max(PATIENCE, FRAMES * this.slowest));
    return true;
  }

  private receive(data: string | ArrayBuffer, others: Others | null, isAnswer: boolean): void {
    const said = typeof data === "string" ? (JSON.parse(data) as { error: string } | { news: string }) : null;
    if (said && "news" in said) return this.onNews(said.news);
    if (isAnswer) {
      this.isWaiting = false;
      clearTimeout(this.alarm);
    }
    if (said) this.refuse(said.error);
    else {
      this.resting += 1;
      this.onFrame(new Float32Array(data as ArrayBuffer), others, isAnswer);
    }
  }

  /** The last request was not followed. If it was for a grasp, what it asked for beside that is asked for again. */
  private refuse(sentence: string): void {
    const { second = {}, ...first } = this.asked;
    const { grab, organ, move, release, ...others } = first;
    const refused = [grab, second.grab].flatMap((place, hand) => (place ? [hand] : []));
    if (refused.length > 0) {
      const [newer, older] = [this.wanted, { ...(grab ? others : first), ...(!second.grab && { second }) }];
      this.wanted = { ...older, ...newer, second: { ...older.second, ...newer.second } };
    }
    const isAnew = [this.wanted.grab, this.wanted.second?.grab].map(Boolean);
    this.onComplaint(sentence, refused.filter((hand) => !isAnew[hand]));
  }
}
