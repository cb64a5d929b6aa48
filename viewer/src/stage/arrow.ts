// The contact: a ring on the surface, and the force as an arrow that pushes or pulls there, or a probe that does.
import * as THREE from "three";
import type { Vec3 } from "../model/evaluator";
import { Probe } from "./probe";

/** What a force is worth: it stands, it is doubtful, or the organ is still on its way. */
export type Standing = "sound" | "doubtful" | "unsettled";

const COLOURS: Record<Standing, number> = { sound: 0x2f7cf6, doubtful: 0xe5352b, unsettled: 0x8b94a3 };
const UP = new THREE.Vector3(0, 1, 0);

export class Arrow {
  readonly group = new THREE.Group();
  private readonly shaft: THREE.Mesh;
  private readonly head: THREE.Mesh;
  private readonly ring: THREE.Mesh;
  private readonly material = new THREE.MeshStandardMaterial({ roughness: 0.35, metalness: 0.05 });
  private readonly probe: Probe;
  private isProbe = false;
  private isForce = false;
  /** Whether the hand holds a probe, which is there without a force, too. */
  private isHeld = false;
  /** The contact, and the arrow's far end, where its number belongs [m]. */
  private readonly foot = new THREE.Vector3();
  private readonly tail = new THREE.Vector3();

  /** Lengths follow the organ's diagonal [m]; the ring marks the contact. */
  constructor(
    private readonly diagonal: number,
    radius: number,
    tip = radius,
  ) {
    const width = 0.0085 * diagonal;
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(width, width, 1, 24).translate(0, 0.5, 0), this.material);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * width, 5 * width, 32).translate(0, 2.5 * width, 0), this.material);
    const torus = new THREE.TorusGeometry(radius, 0.003 * diagonal, 12, 64);
    this.ring = new THREE.Mesh(torus, new THREE.MeshBasicMaterial({ color: 0xffffff, transparent: true, opacity: 0.75 }));
    this.probe = new Probe(diagonal, tip, this.material);
    this.group.add(this.shaft, this.head, this.ring, this.probe.group);
    this.group.visible = false;
  }

  /**
   * A force at a point: its length is the share of the reference force; a push ends at the surface, a pull
   * starts there. A probe that the hand holds has its centre where it is; a picture of one touches the point.
   */
  show(at: Vec3, force: Vec3, outward: Vec3, reference: number, standing: Standing, center: Vec3 | null = null): void {
    const F = new THREE.Vector3(...force);
    const size = F.length();
    const direction = size > 0 ? F.clone().divideScalar(size) : new THREE.Vector3(...outward).negate();
    const length = this.diagonal * Math.min(0.1 + 0.3 * (size / reference), 0.6);
    const headLength = 5 * 0.0085 * this.diagonal;
    const point = new THREE.Vector3(...at);
    const isPull = direction.dot(new THREE.Vector3(...outward)) > 0;
    const start = isPull ? point : point.clone().addScaledVector(direction, -length);
    const turn = new THREE.Quaternion().setFromUnitVectors(UP, direction);
    this.shaft.position.copy(start);
    this.shaft.quaternion.copy(turn);
    this.shaft.scale.set(1, length - headLength, 1);
    this.head.position.copy(start).addScaledVector(direction, length - headLength);
    this.head.quaternion.copy(turn);
    const normal = new THREE.Vector3(...outward);
    const tip = center ? new THREE.Vector3(...center) : point.clone().addScaledVector(normal, this.probe.radius);
    this.probe.place(tip, normal);
    this.isHeld = center !== null;
    this.foot.copy(point);
    if (this.isProbe) this.tail.copy(this.probe.end(tip, normal));
    else this.tail.copy(isPull ? start.clone().addScaledVector(direction, length) : start);
    this.isForce = size > 1e-3 * reference;
    this.choose();
    this.material.color.set(COLOURS[standing]);
    this.mark(at, outward);
  }

  /** The ring alone: where a press would touch. */
  mark(at: Vec3, outward: Vec3): void {
    const normal = new THREE.Vector3(...outward);
    this.ring.position.set(...at).addScaledVector(normal, 0.006 * this.diagonal);
    this.ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    this.group.visible = true;
  }

  hover(at: Vec3, outward: Vec3): void {
    this.isForce = this.isHeld = false;
    this.shaft.visible = this.head.visible = this.probe.group.visible = false;
    this.mark(at, outward);
  }

  /** Whether a probe stands where the arrow does. */
  set hasProbe(isProbe: boolean) {
    this.isProbe = isProbe;
    this.choose();
  }

  hide(): void {
    this.group.visible = false;
  }

  /** The contact and the far end in the scene. */
  endsInScene(): [THREE.Vector3, THREE.Vector3] {
    return [this.group.localToWorld(this.foot.clone()), this.group.localToWorld(this.tail.clone())];
  }

  get hasForce(): boolean {
    return this.group.visible && this.isForce;
  }

  private choose(): void {
    this.shaft.visible = this.head.visible = this.isForce && !this.isProbe;
    this.probe.group.visible = (this.isForce || this.isHeld) && this.isProbe;
  }

  dispose(): void {
    for (const part of [this.shaft, this.head, this.ring]) {
      part.geometry.dispose();
      (part.material as THREE.Material).dispose();
    }
    this.probe.dispose();
  }
}
