// What a load path leaves behind, as in paper A's figure 15: the path of the contact, and the shapes at some of its stations.
import * as THREE from "three";
import { colourAt, VIRIDIS, type Rgb } from "./colour";
import type { Evaluator } from "../model/evaluator";
import type { Station } from "./loadpath";

/** Stations whose shape stays. */
export const SHAPES = 7;
/** A shape is drawn as far from its contact as so many radii of the patch. */
const AROUND = 2;

export class Trail {
  readonly group = new THREE.Group();
  /** Shapes that stay so far. */
  shapes = 0;
  private readonly line: THREE.Line<THREE.BufferGeometry, THREE.LineBasicMaterial>;
  private readonly footprints: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial>[] = [];

  constructor(
    private readonly evaluator: Evaluator,
    private readonly stations: readonly Station[],
  ) {
    const places = stations.map(({ point, displacement }) => new THREE.Vector3(...point).add(new THREE.Vector3(...displacement)));
    const geometry = new THREE.BufferGeometry().setFromPoints(places);
    geometry.setDrawRange(0, 0);
    this.line = new THREE.Line(geometry, seenThrough(0xffd166, 0.95));
    this.line.renderOrder = 2;
    this.group.add(this.line);
  }

  /** Comes as far as a share of the path, in the field of an order. */
  reach(share: number, order: number): void {
    const { drawRange } = this.line.geometry;
    drawRange.count = Math.max(drawRange.count, Math.round(share * this.stations.length));
    while (this.shapes < SHAPES && share >= at(this.shapes)) this.leave(this.shapes++, order);
  }

  clear(): void {
    this.line.geometry.setDrawRange(0, 0);
    this.shapes = 0;
    for (const footprint of this.footprints.splice(0)) {
      this.group.remove(footprint);
      footprint.geometry.dispose();
      footprint.material.dispose();
    }
  }

  dispose(): void {
    this.clear();
    this.line.geometry.dispose();
    this.line.material.dispose();
  }

  /** The station of a shape that stays. */
  station(shape: number): Station {
    return this.stations[Math.round(at(shape) * (this.stations.length - 1))]!;
  }

  /** Leaves the shape of a station around its contact: the surface's edges, coloured by the share of the path. */
  private leave(shape: number, order: number): void {
    const { evaluator } = this;
    const { point, displacement } = this.station(shape);
    evaluator.touch(point);
    const field = evaluator.surface(displacement, order, 1);
    const reach = AROUND * evaluator.about.metadata.radius;
    const isNear = (row: number) => Math.hypot(...point.map((x, i) => x - evaluator.rest[3 * row + i]!)) < reach;
    const pairs: number[] = [];
    for (let t = 0; t < evaluator.triangles.length; t += 3) {
      for (let k = 0; k < 3; k++) {
        const [a, b] = [evaluator.triangles[t + k]!, evaluator.triangles[t + ((k + 1) % 3)]!];
        if (a < b && isNear(a) && isNear(b)) pairs.push(a, b);
      }
    }
    const moved = evaluator.rest.map((x, i) => x + field[i]!);
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(moved, 3)).setIndex(pairs);
    const [r, g, b] = colourAt(VIRIDIS, 0.15 + 0.8 * at(shape), [0, 0, 0] as Rgb);
    const colour = new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
    const footprint = new THREE.LineSegments(geometry, seenThrough(colour, 0.55));
    footprint.renderOrder = 1;
    this.footprints.push(footprint);
    this.group.add(footprint);
  }
}

/** Share of the path where a shape stays: evenly, not at the ends, where the contact does not push. */
function at(shape: number): number {
  return (shape + 0.5) / SHAPES;
}

/** Lines that the organ does not hide: a shape pushed in lies within the one seen. */
function seenThrough(color: THREE.ColorRepresentation, opacity: number): THREE.LineBasicMaterial {
  return new THREE.LineBasicMaterial({ color, transparent: true, opacity, depthTest: false });
}

