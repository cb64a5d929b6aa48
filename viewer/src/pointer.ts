// The mouse or a finger as a hand: a press on the organ touches it, moving displaces the contact.
import * as THREE from "three";
import type { Body, Hit } from "./body";
import type { Vec3 } from "./evaluator";
import type { Stage } from "./stage";

/** How moving displaces: along the surface's normal, or in the plane of the screen. */
export type Tool = "push" | "drag";

/** Whoever is touched: the displacement is from where the hand took hold [m]. */
export interface Touched {
  grab(hit: Hit): void;
  move(displacement: Vec3): void;
  release(): void;
  hover(hit: Hit | null): void;
  /** Outward normal at the contact, and the displacement it already has. */
  contact(): { normal: Vec3; displacement: Vec3 } | null;
  readonly tool: Tool;
  readonly depth: number;
  /** Whether the wheel is meant for the view, not for what it is embedded in. */
  readonly isInUse: boolean;
}

export class Pointer {
  private readonly ray = new THREE.Raycaster();
  private held: { id: number; start: THREE.Vector3; base: Vec3; wheel: number; last: PointerEvent } | null = null;
  /** Fingers on the canvas, with where they came down; two are the camera's. */
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
    canvas.addEventListener("pointerleave", () => !this.held && touched.hover(null), { signal });
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
    if (event.pointerType === "touch") {
      this.fingers.set(event.pointerId, event);
      if (this.fingers.size > 1) return this.handOn();
    }
    if (event.button !== 0 || this.held) return;
    const hit = this.under(event.offsetX, event.offsetY);
    if (!hit) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    this.stage.canvas.focus({ preventScroll: true });
    this.stage.controls.enabled = false;
    this.touched.grab(hit);
    const base = this.touched.contact()?.displacement ?? [0, 0, 0];
    this.held = { id: event.pointerId, start: hit.moved.clone(), base, wheel: 0, last: event };
    this.stage.canvas.setPointerCapture(event.pointerId);
    this.stage.canvas.classList.add("is-holding");
  }

  private moveTo(event: PointerEvent): void {
    if (!this.held) {
      if (event.buttons === 0) {
        const hit = this.under(event.offsetX, event.offsetY);
        this.stage.canvas.classList.toggle("is-touchable", hit !== null);
        this.touched.hover(hit);
      }
      return;
    }
    if (event.pointerId !== this.held.id) return;
    this.held.last = event;
    this.displace();
  }

  private lift(event: PointerEvent): void {
    this.fingers.delete(event.pointerId);
    if (event.pointerId === this.held?.id) this.letGo();
  }

  private letGo(): void {
    this.held = null;
    this.stage.controls.enabled = true;
    this.stage.canvas.classList.remove("is-holding");
    this.touched.release();
  }

  /** A second finger has come: what the first one did is undone, and the camera gets it. */
  private handOn(): void {
    if (!this.held) return;
    const { id, base } = this.held;
    this.touched.move(base);
    this.letGo();
    const { pointerType, clientX, clientY, screenX, screenY } = this.fingers.get(id)!;
    const first = { pointerId: id, pointerType, clientX, clientY, screenX, screenY, isPrimary: true, bubbles: true, composed: true };
    this.stage.canvas.dispatchEvent(new PointerEvent("pointerdown", first));
  }

  private roll(event: WheelEvent): void {
    if (!this.touched.isInUse) return event.stopImmediatePropagation();
    if (!this.held) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.held.wheel += event.deltaY;
    this.displace();
  }

  private displace(): void {
    const contact = this.touched.contact();
    if (!this.held || !contact) return;
    const { start, base, wheel, last } = this.held;
    const drag = this.inScreenPlane(start, last);
    const normal = new THREE.Vector3(...contact.normal);
    const isPush = (this.touched.tool === "push") !== last.shiftKey;
    const d = new THREE.Vector3(...base);
    if (isPush) d.addScaledVector(normal, -this.pushOf(drag, normal));
    else d.add(drag);
    d.addScaledVector(normal, -wheel * 0.0004 * this.touched.depth * 10);
    this.touched.move(d.toArray());
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
