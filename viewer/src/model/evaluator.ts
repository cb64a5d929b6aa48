// The Rust evaluator (bindings/wasm) as an object: names for its numbers, nothing computed here.
import wasmUrl from "../../wasm/evaluator.wasm?url";
import { bytesOf } from "./base64";
import { requireRoom, withinMemory } from "./memory";
import { requireOf } from "./needs";

export type Vec3 = [number, number, number];
export type Trust = "trusted" | "beyond-depth" | "error-too-large" | "no-number";
const TRUST: Trust[] = ["trusted", "beyond-depth", "error-too-large", "no-number"];

/** What a touch gives back: SI units. */
export interface Answer {
  point: Vec3;
  force: Vec3;
  stiffness: number[];
  /** Estimated relative error of the force, and whether it may be relied on. */
  error: number;
  trust: Trust;
  /** The same of the shape, which a compressed model knows less well. */
  shapeError: number;
  shapeTrust: Trust;
}

/** What a sphere does at a place. */
export type Grip = "free" | "sticks" | "slides" | "inside" | "lost";
const GRIP: Grip[] = ["free", "sticks", "slides", "inside", "lost"];

/** What a sphere touches beside the place that the model answers for. */
export type Beside = "nothing" | "support" | "second-place" | "untouchable";
const BESIDE: Beside[] = ["nothing", "support", "second-place", "untouchable"];

/** What a sphere feels at a place, and how it displaces the contact that it holds [m]. */
export interface Felt extends Answer {
  center: Vec3;
  displacement: Vec3;
  /** From the surface at rest [m]; negative where the sphere has entered it. */
  gap: number;
  grip: Grip;
  beside: Beside;
  /** The estimated error that decides, the largest that is trusted, and the part of the contact: 0 of the model's own. */
  decisive: { estimate: number; allowed: number; ofContact: number };
}

/** A part by name, and its surface as triangles between rows of the model's nodes. */
export interface Part {
  name: string;
  triangles: number[];
}

/** What Python writes for the page (viscera/viewer/surface.py). */
export interface Notes {
  name?: string;
  web?: { worst_error: number; touches: number };
  /** Parts within, and the anatomical axes, "RAS", "LPS" or empty. */
  inside?: Part[];
  axes?: string;
  is_stress_free?: boolean;
  /** Of a model about a preload: where the surface nodes are without the load (s, 3) [m]. */
  unloaded?: number[];
  /** Of a model for a range of a parameter: its name and unit, the value that is shown, and the range. */
  parameter?: { name: string; unit: string; value: number; range: [number, number] };
}

/** What a model file says about itself (docs/model-file.md), and its sizes. */
export interface Description {
  metadata: {
    law: string;
    radius: number;
    depth: number;
    order: number;
    diagonal: number;
    errors: Record<string, number>;
    user: Notes | null;
  };
  n_points: number;
  n_surface: number;
  n_triangles: number;
  n_touchable: number;
  n_positions: number;
  n_regions: number;
  n_modes: number;
  n_terms: number;
}

interface Exports {
  memory: WebAssembly.Memory;
  page_allocate(len: number): number;
  page_release(bytes: number, len: number): void;
  organ_open(bytes: number, len: number): number;
  organ_close(organ: number): void;
  organ_describe(organ: number): void;
  page_message(): number;
  page_message_len(): number;
  organ_table(organ: number, which: number): number;
  organ_rest(organ: number): number;
  organ_touch(organ: number, x: number, y: number, z: number): number;
  organ_evaluate(organ: number, x: number, y: number, z: number): number;
  organ_shape_trust(organ: number): number;
  organ_answer(organ: number): number;
  organ_place(organ: number, x: number, y: number, z: number): number;
  organ_felt(organ: number): number;
  organ_lift(organ: number): void;
  organ_pair_begin(organ: number, hand: number): void;
  organ_pair_place(organ: number, ax: number, ay: number, az: number, bx: number, by: number, bz: number): void;
  organ_pair_choose(organ: number, hand: number): number;
  organ_pair_end(organ: number, hand: number): void;
  organ_force(organ: number, x: number, y: number, z: number, order: number): number;
  organ_surface(organ: number, x: number, y: number, z: number, order: number, slot: number): number;
  organ_volume(organ: number, slot: number): number;
  organ_mode(organ: number, mode: number): number;
  organ_mode_amplitude(organ: number, mode: number, term: number): number;
}

/** Two fields are kept side by side: the one that is shown, and one to compare it with. */
export type Slot = 0 | 1;

export class Evaluator {
  readonly about: Description;
  /** Rest positions of the surface nodes [m]. */
  readonly rest: Float32Array;
  readonly triangles: Uint32Array;
  /** Rows of the nodes on the surface; others are of parts within. */
  readonly outer: Uint32Array;
  readonly touchable: Uint32Array;
  /** Load positions, by row of the surface nodes. */
  readonly positions: Uint32Array;
  readonly positionRegion: Uint32Array;
  readonly regionStart: Uint32Array;
  /** All stiffnesses times this: where rest is free of stress, the shape of a touch stays and its force grows with it. */
  factor = 1;

  private constructor(
    private readonly wasm: Exports,
    private readonly organ: number,
  ) {
    wasm.organ_describe(organ);
    this.about = JSON.parse(this.message()) as Description;
    const n = this.about;
    const table = (which: number, length: number) =>
      new Uint32Array(wasm.memory.buffer, wasm.organ_table(organ, which), length).slice();
    this.triangles = table(0, 3 * n.n_triangles);
    this.outer = Uint32Array.from(new Set(this.triangles));
    this.touchable = table(1, 3 * n.n_touchable);
    this.positions = table(2, n.n_positions);
    this.positionRegion = table(3, n.n_positions);
    this.regionStart = table(4, n.n_regions + 1);
    this.rest = this.singles(wasm.organ_rest(organ), 3 * n.n_surface).slice();
  }

  /** Reads the bytes of a model file; throws a sentence where they are none, or too many for the page's memory. */
  static async load(model: Uint8Array): Promise<Evaluator> {
    requireOf("WebAssembly");
    requireRoom(model.length);
    const { instance } = await WebAssembly.instantiate(decode(wasmUrl), {});
    const wasm = instance.exports as unknown as Exports;
    return withinMemory(model.length, () => {
      const bytes = wasm.page_allocate(model.length);
      new Uint8Array(wasm.memory.buffer, bytes, model.length).set(model);
      const organ = wasm.organ_open(bytes, model.length);
      wasm.page_release(bytes, model.length);
      if (organ === 0) throw new Error(text(wasm));
      return new Evaluator(wasm, organ);
    });
  }

  /** What Python wrote for the page. */
  get notes(): Notes {
    return this.about.metadata.user ?? {};
  }

  /** Positions (s, 3) of the surface nodes without the load that the model is about [m]; at rest where there is none. */
  get unloaded(): Float32Array {
    return this.notes.unloaded ? Float32Array.from(this.notes.unloaded) : this.rest;
  }

  /** Length of the bounding box's diagonal [m]. */
  get diagonal(): number {
    return this.about.metadata.diagonal;
  }

  dispose(): void {
    this.wasm.organ_close(this.organ);
  }

  /** Touches the closest point of the touchable surface; null where the point is no contact. */
  touch(point: Vec3): Vec3 | null {
    if (this.wasm.organ_touch(this.organ, ...point) < 0) return null;
    return [...this.doubles(this.wasm.organ_answer(this.organ), 3)] as Vec3;
  }

  /** The answer to the contact displaced by d [m]. */
  evaluate(d: Vec3): Answer {
    return this.answer(this.wasm.organ_evaluate(this.organ, ...d));
  }

  /** Moves a sphere, as wide as the patch, to a place [m]; what it holds there is the contact from now on. */
  place(center: Vec3): Felt {
    return this.felt(this.wasm.organ_place(this.organ, ...center), center);
  }

  /** Takes the sphere from the organ: the next place is a first one. */
  lift(): void {
    this.wasm.organ_lift(this.organ);
  }

  /** A second sphere joins the one in a hand, 0 or 1; both feel each other until one of them is left. */
  beginPair(hand: number): void {
    this.wasm.organ_pair_begin(this.organ, hand);
  }

  /** Moves the spheres of both hands to places [m]. */
  placePair(centers: readonly [Vec3, Vec3]): [Felt, Felt] {
    this.wasm.organ_pair_place(this.organ, ...centers[0], ...centers[1]);
    return [this.choose(0, centers[0]), this.choose(1, centers[1])];
  }

  /** Of the two spheres that of a hand, at this place [m]: its contact is the one from now on. */
  choose(hand: number, center: Vec3): Felt {
    return this.felt(this.wasm.organ_pair_choose(this.organ, hand), center);
  }

  /** The sphere in a hand goes on alone. */
  endPair(hand: number): void {
    this.wasm.organ_pair_end(this.organ, hand);
  }

  private felt(trust: number, center: Vec3): Felt {
    const answer = this.answer(trust);
    const [x, y, z, gap, grip, beside, estimate, allowed, ofContact] = this.doubles(this.wasm.organ_felt(this.organ), 9);
    const decisive = { estimate: estimate!, allowed: allowed!, ofContact: ofContact! };
    const displacement: Vec3 = [x!, y!, z!];
    return { ...answer, center, displacement, gap: gap!, grip: GRIP[grip!] ?? "lost", beside: BESIDE[beside!] ?? "nothing", decisive };
  }

  private answer(trust: number): Answer {
    const numbers = [...this.doubles(this.wasm.organ_answer(this.organ), 17)];
    for (let i = 3; i < 15; i++) numbers[i]! *= this.factor;
    return {
      point: numbers.slice(0, 3) as Vec3,
      force: numbers.slice(3, 6) as Vec3,
      stiffness: numbers.slice(6, 15),
      error: numbers[15] ?? 1,
      trust: TRUST[trust] ?? "no-number",
      shapeError: numbers[16] ?? 1,
      shapeTrust: TRUST[this.wasm.organ_shape_trust(this.organ)] ?? "no-number",
    };
  }

  /** Force [N] of the series cut after an order. */
  force(d: Vec3, order: number): Vec3 {
    const force = this.doubles(this.wasm.organ_force(this.organ, ...d, order), 3);
    return Array.from(force, (f) => this.factor * f) as Vec3;
  }

  /** Displacement [m] of the surface nodes for the series cut after an order; a view, valid until the slot's next use. */
  surface(d: Vec3, order: number, slot: Slot): Float32Array {
    return this.singles(this.wasm.organ_surface(this.organ, ...d, order, slot), 3 * this.about.n_surface);
  }

  /** Volume [m^3] inside the surface displaced as in a slot. */
  volume(slot: Slot): number {
    return this.wasm.organ_volume(this.organ, slot);
  }

  /** A spatial mode F at the surface nodes, largest component 1; a view. */
  mode(mode: number): Float32Array {
    return this.singles(this.wasm.organ_mode(this.organ, mode), 3 * this.about.n_surface);
  }

  /** Its function G over the load positions, in one term of the series at full depth [m]; a view. */
  modeAmplitude(mode: number, term: number): Float32Array {
    return this.singles(this.wasm.organ_mode_amplitude(this.organ, mode, term), this.about.n_positions);
  }

  private message(): string {
    return text(this.wasm);
  }

  private singles(at: number, length: number): Float32Array {
    return new Float32Array(this.wasm.memory.buffer, at, length);
  }

  private doubles(at: number, length: number): Float64Array {
    return new Float64Array(this.wasm.memory.buffer, at, length);
  }
}

function text(wasm: Exports): string {
  return new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, wasm.page_message(), wasm.page_message_len()).slice());
}

/** The bytes of a base64 data URL; not fetched, so that a strict content policy holds. */
function decode(url: string): Uint8Array<ArrayBuffer> {
  return bytesOf(url.slice(url.indexOf(",") + 1));
}
