// What lies within: cell sets, a tumour or vessels, as surfaces that move with the touch, and how far they have moved.
import * as THREE from "three";
import { decimalsOf, element, fixed, write } from "../base/dom";
import type { Part, Vec3 } from "../model/evaluator";
import { Skin } from "./skin";

/** How far a part has moved [m], and the half width of the band around it [m]: viscera/reduced/parts.py says what it is. */
export interface Shift {
  name: string;
  distance: number;
  band: number;
}

/** Distinct under every kind of colour blindness, and from tissue (Okabe and Ito, 2008). */
const COLOURS = [0xf0e442, 0x56b4e9, 0x009e73, 0xcc79a7, 0xe69f00, 0x0072b2] as const;

export class Inside {
  readonly group = new THREE.Group();
  readonly root = element("section", { class: "panel inside", "aria-label": "parts within" });
  private readonly pieces: readonly InnerPart[];

  constructor(rest: Float32Array, parts: readonly Part[]) {
    this.pieces = parts.map((part, k) => new InnerPart(rest, part, COLOURS[k % COLOURS.length]!));
    this.pieces.forEach(({ mesh }) => this.group.add(mesh));
    this.root.append(element("dl", {}, ...this.pieces.map(({ row }) => row)));
    this.root.hidden = this.isEmpty;
  }

  /** Whether there is no part. */
  get isEmpty(): boolean {
    return this.pieces.length === 0;
  }

  /** Moves the parts by a field (s, 3) [m]; null is the shape at rest. */
  move(field: Float32Array | null): void {
    this.pieces.forEach((piece) => piece.move(field));
  }

  /** How far the parts have moved under a field of this relative error, whose nodes move by `typical` [m] in the mean. */
  shifts(field: Float32Array, error: number, typical: number): Shift[] {
    return this.pieces.map(({ part, weights, rows }) => {
      const mean: Vec3 = [0, 0, 0];
      rows.forEach((row, k) => {
        for (let i = 0; i < 3; i++) mean[i]! += weights[k]! * field[3 * row + i]!;
      });
      const distance = Math.hypot(...mean);
      return { name: part.name, distance, band: error * Math.hypot(distance, typical) };
    });
  }

  /** Writes how far they have moved; null where nobody touches. */
  show(shifts: readonly Shift[] | null, isTrusted: boolean): void {
    this.pieces.forEach((piece, k) => piece.say(shifts?.[k] ?? null, isTrusted));
  }

  dispose(): void {
    this.pieces.forEach((piece) => piece.dispose());
  }
}

/** A part's surface on the stage, and its line in the readings. */
class InnerPart {
  readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshStandardMaterial>;
  readonly row: HTMLElement;
  /** Its nodes, by row of the model's, and their shares of its area: they give its centroid. */
  readonly rows: Uint32Array;
  readonly weights: Float64Array;
  private readonly rest: Float32Array;
  private readonly moved: Float32Array;
  private readonly skin: Skin;
  private readonly value = element("dd", {}, "–");

  constructor(
    rest: Float32Array,
    readonly part: Part,
    colour: number,
  ) {
    const all = Uint32Array.from(part.triangles);
    this.rows = Uint32Array.from(new Set(all)).sort();
    const place = new Map(Array.from(this.rows, (row, k) => [row, k]));
    const triangles = all.map((row) => place.get(row)!);
    this.rest = new Float32Array(3 * this.rows.length);
    this.rows.forEach((row, k) => this.rest.set(rest.subarray(3 * row, 3 * row + 3), 3 * k));
    this.moved = this.rest.slice();
    this.weights = areaShares(this.rest, triangles);
    this.skin = new Skin(this.rest, triangles);
    const geometry = new THREE.BufferGeometry();
    geometry.setIndex(new THREE.BufferAttribute(this.skin.triangles, 1));
    geometry.setAttribute("position", new THREE.BufferAttribute(this.skin.positions, 3).setUsage(THREE.DynamicDrawUsage));
    geometry.setAttribute("normal", new THREE.BufferAttribute(this.skin.normals, 3).setUsage(THREE.DynamicDrawUsage));
    this.mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color: colour, roughness: 0.6 }));
    this.mesh.frustumCulled = false;
    const swatch = element("span", { class: "swatch", style: `background:#${colour.toString(16).padStart(6, "0")}` });
    this.row = element("div", {}, element("dt", {}, swatch, part.name), this.value);
  }

  move(field: Float32Array | null): void {
    this.rows.forEach((row, k) => {
      for (let i = 0; i < 3; i++) this.moved[3 * k + i] = this.rest[3 * k + i]! + (field ? field[3 * row + i]! : 0);
    });
    this.skin.shape(this.moved);
    for (const name of ["position", "normal"]) this.mesh.geometry.getAttribute(name).needsUpdate = true;
  }

  say(shift: Shift | null, isTrusted: boolean): void {
    write(this.value, shift ? shiftInWords(shift) : "–");
    this.value.classList.toggle("is-wrong", shift !== null && !isTrusted);
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}

/** Decimals of a length in millimetres at the most: what is smaller is rounding. */
const FINEST = 6;

/** "6.21 ± 0.29 mm", which holds all that the band holds; viscera/reduced/parts.py says how it is rounded, and does the same. */
export function shiftInWords(shift: Shift): string {
  const [distance, band] = [1000 * shift.distance, 1000 * shift.band];
  const sizes: [number, number][] = [[band, 2], [distance, 4]];
  const places = sizes.filter(([size]) => size > 0 && size < Infinity).map(([size, count]) => decimalsOf(size, count));
  const decimals = places.length > 0 ? Math.max(Math.min(...places, FINEST), 0) : 1;
  const lost = Math.abs(Number(distance.toFixed(decimals)) - distance);
  // A product that floating point puts just above a whole number is not rounded up to the next one.
  const units = Math.ceil((band + lost) * 10 ** decimals * (1 - 1e-9));
  return `${fixed(distance, decimals)} ± ${fixed(units / 10 ** decimals, decimals)} mm`;
}

/** A third of the area of the triangles around each node, as a part of all. */
function areaShares(points: Float32Array, triangles: Uint32Array): Float64Array {
  const shares = new Float64Array(points.length / 3);
  const corner = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()] as const;
  let total = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    corner.forEach((x, k) => x.fromArray(points, 3 * triangles[t + k]!));
    const area = corner[1].sub(corner[0]).cross(corner[2].sub(corner[0])).length();
    for (let k = 0; k < 3; k++) shares[triangles[t + k]!]! += area;
    total += 3 * area;
  }
  return shares.map((share) => share / total);
}
