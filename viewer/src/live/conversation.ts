// What is said between a view and its stepper: one request at a time, the wishes of a moment gathered in it, frames back.
import type { Vec3 } from "../model/evaluator";
import type { Link } from "./link";
import type { Around } from "../stage/surroundings";

/** What the stepper says first (live/src/stage.rs, python/viscera/viewer/stepped.py). */
export interface Hello extends Partial<Around> {
  name: string;
  laws: string[];
  law: string;
  diagonal: number;
  radius: number;
  /** Null where none can be chosen. */
  gravity: Vec3 | null;
  /** Kinds of loads of the case that are not applied. */
  left_out?: string[];
  /** The graphics processor that steps it, if one does. */
  device?: string | null;
  /** What the page's address asks for of it in vain. */
  refusal?: string | null;
  /** Whether it is a solved state, which no hand can move. */
  is_still?: boolean;
  /** False where it has no stress to colour by. */
  has_stress?: boolean;
  rest: number[];
  triangles: number[];
  /** Where it may be touched; everywhere if it is not said. */
  touchable?: number[];
  /** Of a scene, the names of its organs, and the number of each node's. */
  organs?: string[];
  organ_of?: number[];
}

/** What a hand does (live/src/request.rs). */
export interface Gesture {
  grab?: Vec3;
  /** Of a scene, the name of the organ that it takes hold of. */
  organ?: string;
  move?: Vec3;
  release?: true;
}

type Request = Gesture & { laws?: string[]; gravity?: Vec3; stress?: boolean; second?: Gesture };

/** What the stepper says first; rejects with the sentence where it refuses. */
export function introduction(link: Link): Promise<Hello> {
  return new Promise((resolve, reject) => {
    link.onClose = (sentence) => reject(new Error(sentence));
    link.onMessage = (data) => {
      const hello = JSON.parse(data as string) as Hello | { error: string };
      if ("error" in hello) reject(new Error(hello.error));
      else resolve(hello);
    };
  });
}

/** What stands below the title: the size of the organ, what steps it, and what of its case it is without. */
export function factsOf({ rest, is_still, device, refusal, left_out }: Hello, place: string): string[] {
  const stepped = device ? `stepped ${place} on ${device}` : `stepped ${place}`;
  const said = [`${rest.length / 3} surface nodes`, is_still ? "a solved state" : stepped];
  if (refusal) said.push(refusal);
  if (left_out?.length) said.push(`loads of the case are not applied: ${left_out.join(", ")}`);
  return said;
}

export class Conversation {
  /** Of a frame that has come: its numbers. */
  onFrame: (numbers: Float32Array) => void = () => {};
  /** What the stepper refused; and the hands that were to take hold by what it refused. */
  onComplaint: (sentence: string, refused: readonly number[]) => void = () => {};
  /** Why the stepper has gone: no frame comes any more. */
  onEnd: (sentence: string) => void = () => {};
  /** What a frame brings in words: why it is stepped another way from now on. */
  onNews: (sentence: string) => void = () => {};
  /** Whether an answer is under way. */
  isWaiting = false;
  private wanted: Request = {};
  /** The last request. */
  private asked: Request = {};

  constructor(private readonly link: Link) {
    link.onMessage = (data) => this.receive(data);
    link.onClose = (sentence) => this.onEnd(sentence);
  }

  /** Whether something is wanted that has not been asked for. */
  get hasWishes(): boolean {
    return Object.keys(this.wanted).length > 0;
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

  /** Asks for a frame where something is wanted or moves; one at a time. */
  ask(isMoving: boolean): void {
    if (this.isWaiting || !this.link.isOpen || !(isMoving || this.hasWishes)) return;
    this.link.send(JSON.stringify(this.wanted));
    this.asked = this.wanted;
    this.wanted = {};
    this.isWaiting = true;
  }

  private receive(data: string | ArrayBuffer): void {
    const said = typeof data === "string" ? (JSON.parse(data) as { error: string } | { news: string }) : null;
    if (said && "news" in said) return this.onNews(said.news);
    this.isWaiting = false;
    if (said) this.refuse(said.error);
    else this.onFrame(new Float32Array(data as ArrayBuffer));
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
