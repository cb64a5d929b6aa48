// A contact that walks a load path, and the trail that it leaves.
import type * as THREE from "three";
import type { Body } from "./body";
import type { Evaluator } from "../model/evaluator";
import { LoadPath, type Station } from "./loadpath";
import { Trail } from "./trail";

export class Walk {
  private path: LoadPath | null = null;
  private trail: Trail | null = null;

  constructor(
    private readonly evaluator: Evaluator,
    private readonly body: Body,
    private readonly world: THREE.Object3D,
  ) {}

  /** Starts from the first station; whether there is one. */
  begin(): boolean {
    this.path ??= new LoadPath(this.evaluator, this.body);
    if (this.path.stations.length === 0) return false;
    this.path.restart();
    this.trail ??= new Trail(this.evaluator, this.path.stations);
    this.world.add(this.trail.group);
    return true;
  }

  /** The station after some more seconds; the shapes of an order stay behind. */
  advance(seconds: number, order: number): Station {
    const station = this.path!.advance(seconds);
    this.trail!.reach(this.path!.gone, order);
    return station;
  }

  end(): void {
    this.trail?.clear();
    this.trail?.group.removeFromParent();
  }

  /** Shapes that stay so far. */
  get shapes(): number {
    return this.trail?.shapes ?? 0;
  }

  dispose(): void {
    this.trail?.dispose();
  }
}
