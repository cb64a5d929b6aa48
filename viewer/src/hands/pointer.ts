// The mouse or a finger as a hand: a press on the organ touches it, moving displaces the contact.
import * as THREE from "three";
import type { Standing } from "../stage/arrow";
import type { Body, Hit } from "../stage/body";
import type { Vec3 } from "../model/evaluator";
import type { Stage } from "../stage/stage";

/** How moving displaces: along the surface's normal, or in the plane of the screen. */
export type Tool = "push" | "drag";

/** What is told of a hand beside its force: the force itself, what it is worth, and where its arrow ends in the scene. */
export interface Reading {
  force: string;
  worth: string;
  standing: Standing;
  at: THREE.Vector3;
}

/** Whoever is touched, by one hand or more, counted from 0: the displacement is from where a hand took hold [m]. */
export interface Touched {
  grab(hit: Hit, hand: number): void;
  move(displacement: Vec3, hand: number): void;
  release(hand: number): void;
  hover(hit: Hit | null): void;
  /** Outward normal at the contact, and the displacement it already has. */
  contact(hand: number): { normal: Vec3; displacement: Vec3 } | null;
  /** Null where a hand does not touch. */
  reading(hand: number): Reading | null;
  /** How many hands may touch at once. */
  readonly hands: number;
  /** Readies what a second hand needs, where one may come; done once two may touch, or once that cannot be. */
  expectTwo?(): Promise<void>;
  readonly tool: Tool;
  readonly depth: number;
  /** A hand that moves farther from where it took hold moves the contact no more [m]. */
  readonly reach: number;
  /** Whether the wheel is meant for the view, not for what it is embedded in. */
  readonly isInUse: boolean;
}

/** A notch of a wheel, in the units that a browser counts in: pixels, lines, pages. */
const NOTCH = [100, 3, 1] as const;
/** It pushes in by this part of the depth. */
const PUSH = 0.1;

/** A finger that lies on the organ before a hand is free for it, and where on the canvas [px]: an event knows while it is told. */
interface Waiting {
  last: PointerEvent;
  x: number;
  y: number;
}

/** A mouse or a finger that holds on: where it took hold [m], what was displaced before, and where it is now. */
interface Drag {
  hand: number;
  start: THREE.Vector3;
  base: Vec3;
  /** How far the wheel has pushed it in [m]. */
  wheel: number;
  last: PointerEvent;
}

export class Pointer {
  private readonly ray = new THREE.Raycaster();
  /** By the browser's number of the pointer. */
  private readonly holding = new Map<number, Drag>();
  /** The second finger, until it may hold on too or the first one has let go. */
  private waiting: Waiting | null = null;
  /** Fingers on the canvas, with where they came down; two are the camera's, unless each holds on. */
  private readonly fingers = new Map<number, PointerEvent>();
  private readonly abort = new AbortController();

  constructor(
    private readonly stage: Stage,
    private readonly body: Pick<Body, "hit">,
    private readonly touched: Touched,
  ) {
    const { canvas } = stage;
    const { signal } = this.abort;
    // Before the camera's controls see the press.
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true, signal });
    canvas.addEventListener("pointermove", (event) => this.moveTo(event), { signal });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(name, (event) => this.lift(event), { signal });
    }
    canvas.addEventListener("pointerleave", () => this.holding.size === 0 && touched.hover(null), { signal });
    canvas.addEventListener("wheel", (event) => this.roll(event), { capture: true, passive: false, signal });
  }

  /** What lies under a place of the canvas. */
  under(x: number, y: number): Hit | null {
    this.aim(x, y);
    return this.body.hit(this.ray);
  }

  /** What lies under a point of the organ [m], or nearest to it on the screen: vessels are hollow, organs bent. */
  near(point: Vec3): Hit | null {
    const { x, y } = this.stage.project(new THREE.Vector3(...point));
    const { clientWidth, clientHeight } = this.stage.canvas;
    const step = 0.03 * Math.min(clientWidth, clientHeight);
    for (let ring = 0; ring <= 10; ring++) {
      for (let k = 0; k < Math.max(1, 8 * ring); k++) {
        const angle = (Math.PI * k) / (4 * ring || 1);
        const hit = this.under(x + ring * step * Math.cos(angle), y + ring * step * Math.sin(angle));
        if (hit) return hit;
      }
    }
    return null;
  }

  dispose(): void {
    this.abort.abort();
  }

  private press(event: PointerEvent): void {
    // What is handed on comes by here again.
    if (!event.isTrusted) return;
    const isTouch = event.pointerType === "touch";
    if (isTouch) {
      this.fingers.set(event.pointerId, event);
      void this.touched.expectTwo?.().then(() => this.admit());
    }
    const isFurther = isTouch && this.fingers.size > 1;
    // With two hands full, or one that waits, a third finger is nobody's.
    if (isFurther && (this.holding.size > 1 || this.waiting)) return event.stopImmediatePropagation();
    const isHand = this.touched.hands > 0 && event.button === 0 && this.holding.size > 0 === isFurther;
    const hit = isHand ? this.under(event.offsetX, event.offsetY) : null;
    if (!hit) return isFurther ? this.handOn() : undefined;
    event.stopImmediatePropagation();
    event.preventDefault();
    if (this.isFree) this.take(event, hit);
    else this.wait(event);
  }

  /** Whether one hand more may touch. */
  private get isFree(): boolean {
    return this.holding.size < this.touched.hands;
  }

  private wait(event: PointerEvent): void {
    this.waiting = { last: event, x: event.offsetX, y: event.offsetY };
  }

  /** The finger that waits takes hold, where it lies on the organ and may. */
  private admit(): void {
    if (!this.waiting || !this.isFree) return;
    const { last, x, y } = this.waiting;
    const hit = this.under(x, y);
    if (!hit) return;
    this.waiting = null;
    this.take(last, hit);
  }

  private take(event: PointerEvent, hit: Hit): void {
    const { canvas, controls } = this.stage;
    canvas.focus({ preventScroll: true });
    controls.enabled = false;
    const taken = Array.from(this.holding.values(), ({ hand }) => hand);
    const hand = taken.includes(0) ? 1 : 0;
    this.touched.grab(hit, hand);
    const base = this.touched.contact(hand)?.displacement ?? [0, 0, 0];
    this.holding.set(event.pointerId, { hand, start: hit.moved.clone(), base, wheel: 0, last: event });
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("is-holding");
  }

  private moveTo(event: PointerEvent): void {
    const held = this.holding.get(event.pointerId);
    if (held) {
      held.last = event;
      this.displace(held);
    } else if (this.waiting?.last.pointerId === event.pointerId) {
      this.wait(event);
      this.admit();
    } else if (this.touched.hands > 0 && this.holding.size === 0 && event.buttons === 0) {
      const hit = this.under(event.offsetX, event.offsetY);
      this.stage.canvas.classList.toggle("is-touchable", hit !== null);
      this.touched.hover(hit);
    }
  }

  private lift(event: PointerEvent): void {
    this.fingers.delete(event.pointerId);
    if (this.waiting?.last.pointerId === event.pointerId) this.waiting = null;
    if (this.holding.has(event.pointerId)) this.letGo(event.pointerId);
    this.admit();
  }

  private letGo(id: number): void {
    const { hand } = this.holding.get(id)!;
    this.holding.delete(id);
    if (this.holding.size === 0) {
      this.stage.controls.enabled = true;
      this.stage.canvas.classList.remove("is-holding");
    }
    this.touched.release(hand);
  }

  /** A second finger has come beside the organ: what the first one did is undone, and the camera gets both. */
  private handOn(): void {
    for (const [id, { hand, base }] of [...this.holding]) {
      this.touched.move(base, hand);
      this.letGo(id);
      const { pointerType, clientX, clientY, screenX, screenY } = this.fingers.get(id)!;
      const first = { pointerId: id, pointerType, clientX, clientY, screenX, screenY, isPrimary: true, bubbles: true, composed: true };
      this.stage.canvas.dispatchEvent(new PointerEvent("pointerdown", first));
    }
  }

  private roll(event: WheelEvent): void {
    if (!this.touched.isInUse) return event.stopImmediatePropagation();
    const [held] = this.holding.values();
    if (!held) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    const contact = this.touched.contact(held.hand);
    if (!contact) return;
    const { depth, reach } = this.touched;
    const normal = new THREE.Vector3(...contact.normal);
    const dragged = -this.dragged(held, normal).dot(normal);
    const turned = held.wheel + (event.deltaY / NOTCH[event.deltaMode as 0 | 1 | 2]) * PUSH * depth;
    // Farther the contact does not go, and what is turned there would have to be turned back first.
    const [least, most] = [Math.min(held.wheel, -reach - dragged), Math.max(held.wheel, reach - dragged)];
    held.wheel = Math.max(least, Math.min(turned, most));
    this.displace(held);
  }

  private displace(held: Drag): void {
    const contact = this.touched.contact(held.hand);
    if (!contact) return;
    const normal = new THREE.Vector3(...contact.normal);
    const d = this.dragged(held, normal).addScaledVector(normal, -held.wheel);
    this.touched.move(d.toArray(), held.hand);
  }

  /** The displacement without the wheel's part [m]. */
  private dragged({ start, base, last }: Drag, normal: THREE.Vector3): THREE.Vector3 {
    const drag = this.inScreenPlane(start, last);
    const isPush = (this.touched.tool === "push") !== last.shiftKey;
    const d = new THREE.Vector3(...base);
    return isPush ? d.addScaledVector(normal, -this.pushOf(drag, normal)) : d.add(drag);
  }

  /** From the place taken hold of to the pointer, in the plane of the screen [m]. */
  private inScreenPlane(start: THREE.Vector3, event: PointerEvent): THREE.Vector3 {
    const { world, camera } = this.stage;
    const forward = camera.getWorldDirection(new THREE.Vector3());
    const from = world.localToWorld(start.clone());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(forward, from);
    this.aim(event.offsetX, event.offsetY);
    const to = this.ray.ray.intersectPlane(plane, new THREE.Vector3()) ?? from;
    return world.worldToLocal(to.clone()).sub(start);
  }

  /** How far a drag pushes in: along the normal as the screen shows it, or downwards where it points at the viewer. */
  private pushOf(drag: THREE.Vector3, normal: THREE.Vector3): number {
    const { camera } = this.stage;
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
    const up = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1);
    const inward = new THREE.Vector2(-normal.dot(right), -normal.dot(up));
    if (inward.length() < 0.35) inward.set(0, -1);
    inward.normalize();
    return inward.x * drag.dot(right) + inward.y * drag.dot(up);
  }

  private aim(x: number, y: number): void {
    const { canvas, camera } = this.stage;
    this.stage.place();
    const place = new THREE.Vector2((2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight);
    this.ray.setFromCamera(place, camera);
  }
}

/** A displacement, shortened to a length [m] where it is longer. */
export function within(displacement: Vec3, longest: number): Vec3 {
  const part = Math.min(1, longest / Math.hypot(...displacement));
  return displacement.map((x) => part * x) as Vec3;
}

/** A contact's displacement moved on by lengths [m] along the screen's axes and along the inward normal. */
export function nudged(
  { camera }: Stage,
  contact: { normal: Vec3; displacement: Vec3 },
  [right, up, inward]: readonly [number, number, number],
): Vec3 {
  const d = new THREE.Vector3(...contact.displacement);
  d.addScaledVector(new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0), right);
  d.addScaledVector(new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1), up);
  d.addScaledVector(new THREE.Vector3(...contact.normal), -inward);
  return d.toArray();
}
