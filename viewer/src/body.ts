// The organ on the stage: a surface that is moved, coloured and hit by rays, and its shape at rest as a wireframe.
import * as THREE from "three";
import { colourAt, linear, type ColourMap, type Rgb } from "./colour";
import type { Evaluator, Vec3 } from "./evaluator";

const TISSUE: Rgb = [0.66, 0.2, 0.165];
const UNTOUCHABLE: Rgb = [0.45, 0.27, 0.25];

/** Where a ray meets the touchable surface: on the moved organ and at rest. */
export interface Hit {
  moved: THREE.Vector3;
  rest: Vec3;
}

export class Body {
  readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhysicalMaterial>;
  readonly outline: THREE.LineSegments;
  private readonly positions: Float32Array;
  private readonly normals: Float32Array;
  private readonly colours: Float32Array;
  /** Which share of the triangles around a node may be touched. */
  private readonly touchability: Float32Array;
  private readonly touchableTriangles: Set<string>;

  constructor(private readonly evaluator: Evaluator) {
    const { rest, triangles } = evaluator;
    this.positions = rest.slice();
    this.normals = new Float32Array(rest.length);
    this.colours = new Float32Array(rest.length);
    this.touchableTriangles = keys(evaluator.touchable);
    this.touchability = this.shares();
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    for (const [name, values] of [
      ["position", this.positions],
      ["normal", this.normals],
      ["color", this.colours],
    ] as const) {
      geometry.setAttribute(name, new THREE.BufferAttribute(values, 3).setUsage(THREE.DynamicDrawUsage));
    }
    // Large enough for every touch: never recomputed, never culled.
    geometry.computeBoundingSphere();
    geometry.boundingSphere!.radius *= 2;
    const material = new THREE.MeshPhysicalMaterial({
      vertexColors: true,
      roughness: 0.5,
      clearcoat: 0.45,
      clearcoatRoughness: 0.32,
      side: THREE.DoubleSide,
    });
    this.mesh = new THREE.Mesh(geometry, material);
    this.outline = new THREE.LineSegments(
      edges(rest, triangles),
      new THREE.LineBasicMaterial({ color: 0x6f7f99, transparent: true, opacity: 0.38, depthWrite: false }),
    );
    this.outline.visible = false;
    this.move(null);
    this.paintTissue();
  }

  /** Moves the surface by a field (s, 3) [m]; null is the shape at rest. */
  move(field: Float32Array | null): void {
    const { rest } = this.evaluator;
    if (field) for (let i = 0; i < rest.length; i++) this.positions[i] = rest[i]! + field[i]!;
    else this.positions.set(rest);
    smoothNormals(this.positions, this.evaluator.triangles, this.normals);
    this.renew("position", "normal");
  }

  paintTissue(): void {
    for (let node = 0; node < this.touchability.length; node++) {
      const share = this.touchability[node]!;
      for (let i = 0; i < 3; i++) {
        this.colours[3 * node + i] = linear(UNTOUCHABLE[i]! + share * (TISSUE[i]! - UNTOUCHABLE[i]!));
      }
    }
    this.gloss(true);
  }

  /** Colours the nodes by numbers (s,) between low and high; NaN is shown as grey. */
  paint(values: ArrayLike<number>, low: number, high: number, map: ColourMap): void {
    const rgb: Rgb = [0, 0, 0];
    const scale = high > low ? 1 / (high - low) : 0;
    for (let node = 0; node < values.length; node++) {
      const value = values[node]!;
      if (Number.isNaN(value)) rgb.fill(0.55);
      else colourAt(map, (value - low) * scale, rgb);
      for (let i = 0; i < 3; i++) this.colours[3 * node + i] = linear(rgb[i]!);
    }
    this.gloss(false);
  }

  /** The touchable point that a ray meets first, if it meets the organ there. */
  hit(ray: THREE.Raycaster): Hit | null {
    const [first] = ray.intersectObject(this.mesh, false);
    if (!first?.face) return null;
    const { a, b, c } = first.face;
    if (!this.touchableTriangles.has(key(a, b, c))) return null;
    const moved = this.mesh.worldToLocal(first.point.clone());
    const at = (values: Float32Array, row: number) => new THREE.Vector3().fromArray(values, 3 * row);
    const corners = [a, b, c].map((row) => at(this.positions, row)) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
    const weights = THREE.Triangle.getBarycoord(moved, ...corners, new THREE.Vector3());
    if (!weights) return null;
    const rest = new THREE.Vector3();
    [a, b, c].forEach((row, k) => rest.addScaledVector(at(this.evaluator.rest, row), weights.getComponent(k)));
    return { moved, rest: rest.toArray() };
  }

  /** Whether a ray meets the organ at all. */
  isMet(ray: THREE.Raycaster): boolean {
    return ray.intersectObject(this.mesh, false).length > 0;
  }

  /** Outward normal at rest, averaged over the nodes closer than a radius. */
  normalAt(point: Vec3, radius: number): Vec3 {
    const { rest, triangles } = this.evaluator;
    const sum = new THREE.Vector3();
    const corner = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()] as const;
    const middle = new THREE.Vector3();
    const centre = new THREE.Vector3(...point);
    for (let reach = radius; sum.lengthSq() === 0; reach *= 2) {
      for (let t = 0; t < triangles.length; t += 3) {
        corner.forEach((x, k) => x.fromArray(rest, 3 * triangles[t + k]!));
        middle.copy(corner[0]).add(corner[1]).add(corner[2]).divideScalar(3);
        const share = 1 - middle.distanceToSquared(centre) / (reach * reach);
        if (share <= 0) continue;
        const normal = corner[1].clone().sub(corner[0]).cross(corner[2].clone().sub(corner[0]));
        sum.addScaledVector(normal, share);
      }
    }
    return sum.normalize().toArray();
  }

  dispose(): void {
    for (const part of [this.mesh, this.outline]) {
      part.geometry.dispose();
      (part.material as THREE.Material).dispose();
    }
  }

  private gloss(isTissue: boolean): void {
    const { material } = this.mesh;
    material.clearcoat = isTissue ? 0.45 : 0.1;
    material.roughness = isTissue ? 0.5 : 0.75;
    this.renew("color");
  }

  private renew(...names: string[]): void {
    for (const name of names) this.mesh.geometry.getAttribute(name).needsUpdate = true;
  }

  private shares(): Float32Array {
    const { triangles, rest } = this.evaluator;
    const [touchable, all] = [new Float32Array(rest.length / 3), new Float32Array(rest.length / 3)];
    for (let t = 0; t < triangles.length; t += 3) {
      const corners = triangles.subarray(t, t + 3);
      const counts = this.touchableTriangles.has(key(corners[0]!, corners[1]!, corners[2]!)) ? 1 : 0;
      for (const row of corners) {
        all[row]! += 1;
        touchable[row]! += counts;
      }
    }
    return touchable.map((count, row) => count / Math.max(all[row]!, 1));
  }
}

/** Normals of nodes as sums of triangle normals, which area weighs. */
function smoothNormals(x: Float32Array, triangles: Uint32Array, out: Float32Array): void {
  out.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!];
    const [ux, uy, uz] = [x[b]! - x[a]!, x[b + 1]! - x[a + 1]!, x[b + 2]! - x[a + 2]!];
    const [vx, vy, vz] = [x[c]! - x[a]!, x[c + 1]! - x[a + 1]!, x[c + 2]! - x[a + 2]!];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const row of [a, b, c]) {
      out[row]! += nx;
      out[row + 1]! += ny;
      out[row + 2]! += nz;
    }
  }
  for (let row = 0; row < out.length; row += 3) {
    const size = Math.hypot(out[row]!, out[row + 1]!, out[row + 2]!) || 1;
    for (let i = 0; i < 3; i++) out[row + i]! /= size;
  }
}

/** A triangle whatever corner comes first. */
function key(a: number, b: number, c: number): string {
  return [a, b, c].sort((x, y) => x - y).join();
}

function keys(triangles: Uint32Array): Set<string> {
  const found = new Set<string>();
  for (let t = 0; t < triangles.length; t += 3) found.add(key(triangles[t]!, triangles[t + 1]!, triangles[t + 2]!));
  return found;
}

/** Every edge of the shape at rest once. */
function edges(rest: Float32Array, triangles: Uint32Array): THREE.BufferGeometry {
  const pairs: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    for (let k = 0; k < 3; k++) {
      const [a, b] = [triangles[t + k]!, triangles[t + ((k + 1) % 3)]!];
      // A closed surface has every edge in both directions.
      if (a < b) pairs.push(a, b);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(rest, 3));
  return geometry.setIndex(pairs);
}
