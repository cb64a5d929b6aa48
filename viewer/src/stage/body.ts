// The organ on the stage: a surface that is moved, coloured and hit by rays, and its shape at rest as a wireframe.
import * as THREE from "three";
import { colourAt, linear, type ColourMap, type Rgb } from "./colour";
import type { Vec3 } from "../model/evaluator";
import { Skin } from "./skin";
import type { Around } from "./surroundings";

/** Of the organs of a scene, one after the other and then from the first again; one organ alone has the first. */
const TISSUES: readonly Rgb[] = [
  [0.56, 0.175, 0.14],
  [0.37, 0.4, 0.13],
  [0.66, 0.42, 0.38],
  [0.36, 0.21, 0.42],
  [0.62, 0.47, 0.24],
  [0.24, 0.35, 0.47],
];
const UNTOUCHABLE: Rgb = [0.4, 0.235, 0.215];
const GREY: Rgb = [0.6, 0.61, 0.63];
/** The colour of an organ's tissue, by its number in a scene. */
export function tissueOf(organ: number): Rgb {
  return TISSUES[organ % TISSUES.length]!;
}

/** Waves in all directions, whose sum mottles the tissue. */
const WAVES = [
  [0.9, 0.4, -0.7, 0.3],
  [-0.5, 1.1, 0.6, 1.9],
  [0.7, -0.8, 1.0, 4.1],
  [1.7, 0.9, 0.8, 2.2],
  [-1.2, 0.6, 1.6, 5.0],
  [0.5, -1.8, -1.1, 0.8],
] as const;

/** A closed surface of triangles at rest [m], which of its triangles may be touched, and what stands around it. */
export interface Surface {
  readonly rest: Float32Array;
  readonly triangles: Uint32Array;
  readonly touchable: Uint32Array;
  readonly diagonal: number;
  /** Of a scene, the number of each node's organ. */
  readonly organOf?: ArrayLike<number>;
  readonly around?: Around;
}

/** Where a ray meets the touchable surface: on the moved organ and at rest [m]; and on which organ of a scene. */
export interface Hit {
  moved: THREE.Vector3;
  rest: Vec3;
  organ?: number;
}

export class Body {
  readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhysicalMaterial>;
  readonly outline: THREE.LineSegments;
  private readonly skin: Skin;
  /** Of the nodes: where they are [m], and their colour. */
  private readonly positions: Float32Array;
  private readonly colours: Float32Array;
  /** Of the vertices that are drawn. */
  private readonly drawnColours: Float32Array;
  private readonly tissue: Float32Array;
  private readonly isTouchable: Uint8Array;
  /** Whether its colours are those of tissue: they stay on the graphics processor then. */
  private isTissue = false;
  /** What lies on its negative side is cut away [m]. */
  private cut: THREE.Plane | null = null;

  constructor(private readonly surface: Surface) {
    const { rest, triangles } = surface;
    this.skin = new Skin(rest, triangles);
    this.positions = rest.slice();
    this.colours = new Float32Array(rest.length);
    this.drawnColours = new Float32Array(this.skin.positions.length);
    this.isTouchable = touchableTriangles(surface);
    this.tissue = this.tissueColours();
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(new THREE.BufferAttribute(this.skin.triangles, 1));
    for (const [name, values] of [
      ["position", this.skin.positions],
      ["normal", this.skin.normals],
      ["color", this.drawnColours],
    ] as const) {
      geometry.setAttribute(name, new THREE.BufferAttribute(values, 3).setUsage(THREE.DynamicDrawUsage));
    }
    // Large enough for every touch: never recomputed, never culled.
    geometry.computeBoundingSphere();
    geometry.boundingSphere!.radius *= 2;
    const material = new THREE.MeshPhysicalMaterial({ vertexColors: true, side: THREE.DoubleSide, clearcoatRoughness: 0.3 });
    this.mesh = new THREE.Mesh(geometry, material);
    this.outline = new THREE.LineSegments(
      edges(rest, triangles),
      new THREE.LineBasicMaterial({ color: 0x7587a5, transparent: true, opacity: 0.42, depthWrite: false }),
    );
    this.outline.visible = false;
    this.paintTissue();
  }

  /** Moves the surface by a field (s, 3) [m]; null is the shape at rest. */
  move(field: Float32Array | null): void {
    const { rest } = this.surface;
    let isOther = false;
    for (let i = 0; i < rest.length; i++) {
      const at = Math.fround(rest[i]! + (field ? field[i]! : 0));
      isOther ||= at !== this.positions[i];
      this.positions[i] = at;
    }
    if (!isOther) return;
    this.skin.shape(this.positions);
    this.renew("position", "normal");
  }

  paintTissue(): void {
    if (this.isTissue) return;
    this.isTissue = true;
    this.drawnColours.set(this.tissue);
    this.renew("color");
    this.gloss(true);
  }

  /** Colours the nodes by numbers (s,) between low and high; NaN is shown as grey. */
  paint(values: ArrayLike<number>, low: number, high: number, map: ColourMap): void {
    let isOther = this.isTissue;
    this.isTissue = false;
    const rgb: Rgb = [0, 0, 0];
    const scale = high > low ? 1 / (high - low) : 0;
    for (let node = 0; node < values.length; node++) {
      const value = values[node]!;
      const shown = Number.isNaN(value) ? GREY : colourAt(map, (value - low) * scale, rgb);
      for (let i = 0; i < 3; i++) {
        const at = Math.fround(linear(shown[i]!));
        isOther ||= at !== this.colours[3 * node + i];
        this.colours[3 * node + i] = at;
      }
    }
    if (!isOther) return;
    this.skin.spread(this.colours, this.drawnColours);
    this.renew("color");
    this.gloss(false);
  }

  /** Shows what lies within: through translucent tissue, or beyond a plane, given in metres and as drawn in the scene. */
  look(isTranslucent: boolean, cut: THREE.Plane | null, drawn: THREE.Plane): void {
    const { material } = this.mesh;
    this.cut = cut;
    material.transparent = isTranslucent;
    material.opacity = isTranslucent ? 0.32 : 1;
    material.depthWrite = !isTranslucent;
    material.clippingPlanes = cut ? [drawn] : null;
    material.needsUpdate = true;
  }

  /** The touchable point that a ray meets first, if it meets the organ there. */
  hit(ray: THREE.Raycaster): Hit | null {
    const isLeft = ({ point }: THREE.Intersection) => !this.cut || this.cut.distanceToPoint(this.mesh.worldToLocal(point.clone())) >= 0;
    const first = ray.intersectObject(this.mesh, false).find(isLeft);
    if (first?.faceIndex == null) return null;
    // Through a cut the far wall is seen from within, where no hand can press.
    const along = ray.ray.direction.clone().transformDirection(this.mesh.matrixWorld.clone().invert());
    if (this.cut && first.face!.normal.dot(along) > 0) return null;
    const triangle = this.skin.parent(first.faceIndex);
    if (!this.isTouchable[triangle]) return null;
    const moved = this.mesh.worldToLocal(first.point.clone());
    const rows = this.surface.triangles.subarray(3 * triangle, 3 * triangle + 3);
    const at = (values: Float32Array, k: number) => new THREE.Vector3().fromArray(values, 3 * rows[k]!);
    const corners = [0, 1, 2].map((k) => at(this.positions, k)) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
    const weights = THREE.Triangle.getBarycoord(moved, ...corners, new THREE.Vector3());
    if (!weights) return null;
    const rest = new THREE.Vector3();
    for (let k = 0; k < 3; k++) rest.addScaledVector(at(this.surface.rest, k), weights.getComponent(k));
    return { moved, rest: rest.toArray(), organ: this.surface.organOf?.[rows[0]!] };
  }

  /** Outward normal at rest, averaged over the triangles closer than a radius; of one organ, where several are near. */
  normalAt(point: Vec3, radius: number, organ?: number): Vec3 {
    const { rest, triangles, organOf } = this.surface;
    const sum = new THREE.Vector3();
    const corner = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()] as const;
    const middle = new THREE.Vector3();
    const centre = new THREE.Vector3(...point);
    for (let reach = radius; sum.lengthSq() === 0; reach *= 2) {
      for (let t = 0; t < triangles.length; t += 3) {
        if (organ !== undefined && organOf?.[triangles[t]!] !== organ) continue;
        corner.forEach((x, k) => x.fromArray(rest, 3 * triangles[t + k]!));
        middle.copy(corner[0]).add(corner[1]).add(corner[2]).divideScalar(3);
        const share = 1 - middle.distanceToSquared(centre) / (reach * reach);
        if (share <= 0) continue;
        corner[1].sub(corner[0]);
        corner[2].sub(corner[0]);
        sum.addScaledVector(corner[1].cross(corner[2]), share);
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

  /** Wet tissue, or a dull surface whose colours are to be read. */
  private gloss(isTissue: boolean): void {
    const { material } = this.mesh;
    material.clearcoat = isTissue ? 0.5 : 0.12;
    material.roughness = isTissue ? 0.46 : 0.8;
  }

  private renew(...names: string[]): void {
    for (const name of names) this.mesh.geometry.getAttribute(name).needsUpdate = true;
  }

  /** Each organ in its own colour, stronger where it may be touched, a little mottled. */
  private tissueColours(): Float32Array {
    const { triangles, rest, diagonal, organOf } = this.surface;
    const [touchable, all] = [new Float32Array(rest.length / 3), new Float32Array(rest.length / 3)];
    triangles.forEach((row, corner) => {
      all[row]! += 1;
      touchable[row]! += this.isTouchable[Math.floor(corner / 3)]!;
    });
    const colours = new Float32Array(rest.length);
    for (let node = 0; node < all.length; node++) {
      const share = touchable[node]! / Math.max(all[node]!, 1);
      const tissue = tissueOf(organOf?.[node] ?? 0);
      for (let i = 0; i < 3; i++) colours[3 * node + i] = UNTOUCHABLE[i]! + share * (tissue[i]! - UNTOUCHABLE[i]!);
    }
    const drawn = new Float32Array(this.skin.positions.length);
    this.skin.spread(colours, drawn);
    const size = 0.018 * diagonal;
    for (let v = 0; v < drawn.length; v += 3) {
      const [x, y, z] = [0, 1, 2].map((i) => this.skin.positions[v + i]! / size) as [number, number, number];
      const mottle = WAVES.reduce((sum, [a, b, c, phase]) => sum + 0.022 * Math.sin(a * x + b * y + c * z + phase), 1);
      for (let i = 0; i < 3; i++) drawn[v + i] = linear(Math.min(1, drawn[v + i]! * mottle));
    }
    return drawn;
  }
}

/** The middle of a surface, and which way its touchable part faces. */
export function lookOver(surface: Surface): { centre: Vec3; facing: Vec3 } {
  const { rest, touchable } = surface;
  const box = new THREE.Box3().setFromArray(Array.from(rest));
  const facing = new THREE.Vector3();
  const corner = (k: number) => new THREE.Vector3().fromArray(rest, 3 * touchable[k]!);
  for (let t = 0; t < touchable.length; t += 3) {
    const a = corner(t);
    facing.add(corner(t + 1).sub(a).cross(corner(t + 2).sub(a)));
  }
  return { centre: box.getCenter(new THREE.Vector3()).toArray(), facing: facing.normalize().toArray() };
}

/** 1 for every surface triangle that is among the touchable ones. */
function touchableTriangles(surface: Surface): Uint8Array {
  const { triangles, touchable } = surface;
  const key = (all: Uint32Array, t: number) => all.slice(3 * t, 3 * t + 3).sort().join();
  const known = new Set(Array.from({ length: touchable.length / 3 }, (_, t) => key(touchable, t)));
  return Uint8Array.from({ length: triangles.length / 3 }, (_, t) => Number(known.has(key(triangles, t))));
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
