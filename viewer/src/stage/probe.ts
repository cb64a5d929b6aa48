// A probe in place of an arrow: a rod with a round tip, in the hand's place.
import * as THREE from "three";

/** Of the organ's diagonal: how long it is, and how wide the rod is at most. Of its tip: how wide the rod is. */
const LENGTH = 0.42;
const SLIMMEST = 0.02;
const SLIM = 0.45;
const UP = new THREE.Vector3(0, 1, 0);

export class Probe {
  readonly group = new THREE.Group();
  private readonly length: number;
  private readonly steel = new THREE.MeshStandardMaterial({ color: 0xb9c0c9, roughness: 0.25, metalness: 0.55 });
  private readonly parts: THREE.Mesh[];

  /** The collar has the material that says what the force is worth. */
  constructor(
    diagonal: number,
    readonly radius: number,
    collar: THREE.Material,
  ) {
    this.length = LENGTH * diagonal;
    const rod = Math.min(SLIM * radius, SLIMMEST * diagonal);
    const long = this.length - radius;
    this.parts = [
      new THREE.Mesh(new THREE.SphereGeometry(radius, 32, 24), this.steel),
      new THREE.Mesh(new THREE.CylinderGeometry(rod, rod, long, 24).translate(0, 0.5 * long, 0), this.steel),
      new THREE.Mesh(new THREE.CylinderGeometry(1.3 * rod, 1.3 * rod, 0.06 * this.length, 24).translate(0, 0.6 * this.length, 0), collar),
    ];
    this.group.add(...this.parts);
    this.group.visible = false;
  }

  /** The centre of its tip, and where its rod goes. */
  place(center: THREE.Vector3, outward: THREE.Vector3): void {
    this.group.position.copy(center);
    this.group.quaternion.setFromUnitVectors(UP, outward);
  }

  /** Its far end. */
  end(center: THREE.Vector3, outward: THREE.Vector3): THREE.Vector3 {
    return center.clone().addScaledVector(outward, this.length - this.radius);
  }

  dispose(): void {
    this.parts.forEach(({ geometry }) => geometry.dispose());
    this.steel.dispose();
  }
}
