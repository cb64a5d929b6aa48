// What stands around an organ: rigid bodies in their pose, springs and cables between their ends.
import * as THREE from "three";
import { RoundedBoxGeometry } from "three/examples/jsm/geometries/RoundedBoxGeometry.js";
import type { Vec3 } from "../model/evaluator";

/** The shape of a rigid body in axes of its own [m], as the classes of these names in Python have it. */
export type Rigid =
  | { shape: "Sphere"; radius: number }
  | { shape: "Capsule"; radius: number; length: number }
  | { shape: "Box"; sides: Vec3; rounding: number }
  | { shape: "HalfSpace" }
  | { shape: "Shape"; points: number[]; triangles: number[] };

/** What does not change from frame to frame. */
export interface Around {
  readonly bodies: readonly Rigid[];
  readonly springs: number;
}

/** Numbers of a frame for each body, its position and the rows of its rotation, and for each spring, its ends. */
const POSE = 12;
const ENDS = 6;
/** Of the organ's diagonal: the side of the plate that stands for a half-space, and how thick springs are. */
const PLATE = 2.5;
const THICK = 0.004;
const UP = new THREE.Vector3(0, 1, 0);

export class Surroundings {
  readonly group = new THREE.Group();
  /** How many numbers of a frame say where all this is. */
  readonly size: number;
  private readonly bodies: THREE.Mesh[];
  private readonly springs: THREE.Mesh[];
  private readonly steel = new THREE.MeshStandardMaterial({ color: 0xb9c0c9, roughness: 0.25, metalness: 0.55 });
  /** What lies on a half-space is seen from below, too. */
  private readonly glass = new THREE.MeshStandardMaterial({
    color: 0x8d99a8,
    roughness: 0.7,
    transparent: true,
    opacity: 0.45,
    depthWrite: false,
    side: THREE.DoubleSide,
  });
  private readonly thread = new THREE.MeshStandardMaterial({ color: 0xe3d5ae, roughness: 0.6 });

  constructor(
    { bodies, springs }: Around,
    diagonal: number,
    /** Of the organ [m]: where the plate of a half-space is centred. */
    private readonly centre: Vec3,
  ) {
    this.size = POSE * bodies.length + ENDS * springs;
    this.bodies = bodies.map((body) => new THREE.Mesh(geometry(body, PLATE * diagonal), body.shape === "HalfSpace" ? this.glass : this.steel));
    const line = new THREE.CylinderGeometry(THICK * diagonal, THICK * diagonal, 1, 12).translate(0, 0.5, 0);
    this.springs = Array.from({ length: springs }, () => new THREE.Mesh(line, this.thread));
    [...this.bodies, ...this.springs].forEach((part) => this.group.add(part));
    this.group.visible = false;
  }

  /** Puts everything where the numbers of a frame say; without any, it is not seen. */
  place(numbers: Float32Array): void {
    this.group.visible = numbers.length > 0;
    if (!this.group.visible) return;
    this.bodies.forEach((body, k) => this.pose(body, numbers.subarray(POSE * k, POSE * (k + 1))));
    const ends = numbers.subarray(POSE * this.bodies.length);
    this.springs.forEach((spring, k) => span(spring, ends.subarray(ENDS * k, ENDS * (k + 1))));
  }

  /** Whether a solid body is met by a ray before it has come so far, in lengths of the scene. */
  hides(ray: THREE.Raycaster, far: number): boolean {
    const solid = this.group.visible ? this.bodies.filter(({ material }) => material === this.steel) : [];
    return ray.intersectObjects(solid, false).some(({ distance }) => distance < far);
  }

  dispose(): void {
    [...this.bodies, ...this.springs].forEach(({ geometry }) => geometry.dispose());
    [this.steel, this.glass, this.thread].forEach((material) => material.dispose());
  }

  private pose(body: THREE.Mesh, [x, y, z, ...rows]: Float32Array): void {
    const [a, b, c, d, e, f, g, h, i] = rows;
    body.matrix.set(a, b, c, x, d, e, f, y, g, h, i, z, 0, 0, 0, 1);
    body.matrix.decompose(body.position, body.quaternion, body.scale);
    if (body.material !== this.glass) return;
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(new THREE.Vector3(c, f, i), body.position);
    plane.projectPoint(new THREE.Vector3(...this.centre), body.position);
  }
}

function geometry(body: Rigid, plate: number): THREE.BufferGeometry {
  switch (body.shape) {
    case "Sphere":
      return new THREE.SphereGeometry(body.radius, 48, 32);
    case "Capsule":
      return new THREE.CapsuleGeometry(body.radius, body.length, 16, 32).rotateX(0.5 * Math.PI);
    case "Box":
      return body.rounding > 0 ? new RoundedBoxGeometry(...body.sides, 4, body.rounding) : new THREE.BoxGeometry(...body.sides);
    case "HalfSpace":
      return new THREE.PlaneGeometry(plate, plate);
    case "Shape": {
      const surface = new THREE.BufferGeometry().setIndex(body.triangles);
      surface.setAttribute("position", new THREE.Float32BufferAttribute(body.points, 3));
      // Edges stay sharp where triangles share no corner.
      const apart = surface.toNonIndexed();
      apart.computeVertexNormals();
      return apart;
    }
  }
}

/** Draws a spring from its first end (3,) to its second (3,) [m]. */
function span(spring: THREE.Mesh, ends: Float32Array): void {
  const along = new THREE.Vector3().fromArray(ends, 3).sub(spring.position.fromArray(ends));
  spring.scale.set(1, along.length(), 1);
  spring.quaternion.setFromUnitVectors(UP, along.normalize());
}
