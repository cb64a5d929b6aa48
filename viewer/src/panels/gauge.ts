// How large the organ is and how it lies: a scale bar at its middle, and its axes as they are seen.
import * as THREE from "three";
import { element } from "../base/dom";
import { scale } from "../base/scale";
import type { Stage } from "../stage/stage";

/** The bar is at most so long [px]; the axes are drawn in a square of this size [px]. */
const LONGEST = 110;
const SIZE = 64;
const SVG = "http://www.w3.org/2000/svg";
/** What lies at the end of each axis, and at its beginning. */
export function endsOf(axes: string): readonly (readonly [string, string])[] | null {
  return ENDS[axes]?.map((end) => [end, OPPOSITE[end]!] as const) ?? null;
}

/** What lies at the end of each axis: to the right, to the front and up of a patient, or the opposite. */
const ENDS: Record<string, readonly [string, string, string]> = { RAS: ["R", "A", "S"], LPS: ["L", "P", "S"] };
export const NAMES: Record<string, string> = { R: "right", L: "left", A: "anterior", P: "posterior", S: "superior", I: "inferior" };
const OPPOSITE: Record<string, string> = { R: "L", L: "R", A: "P", P: "A", S: "I" };
const COLOURS = ["#d1495b", "#3a9b4f", "#2f7cf6"] as const;

export class Gauge {
  readonly root = element("div", { class: "gauge" });
  private readonly bar = element("div", { class: "gauge-bar" });
  private readonly arms: Arm[];
  private drawn = "";

  constructor(
    private readonly stage: Stage,
    axes = "",
  ) {
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", `${-SIZE / 2} ${-SIZE / 2} ${SIZE} ${SIZE}`);
    svg.setAttribute("role", "img");
    const ends = ENDS[axes];
    svg.setAttribute("aria-label", ends ? `axes: ${ends.map((end) => NAMES[end]).join(", ")}` : "axes x, y, z");
    this.arms = [0, 1, 2].flatMap((axis) => {
      const unit = new THREE.Vector3().setComponent(axis, 1);
      const colour = COLOURS[axis]!;
      if (!ends) return [new Arm(svg, unit, "xyz"[axis]!, colour)];
      const end = ends[axis]!;
      return [new Arm(svg, unit, end, colour), new Arm(svg, unit.clone().negate(), OPPOSITE[end]!, colour)];
    });
    this.root.append(svg, this.bar);
  }

  /** The letters as they stand on the screen, for programs: to the right and up [-1, 1]. */
  get letters(): Record<string, [number, number]> {
    return Object.fromEntries(this.arms.map(({ letter, at }) => [letter, at]));
  }

  /** Follows the camera. */
  follow(): void {
    const { stage } = this;
    const { camera, canvas, clearing } = stage;
    // Where hardly anything of the organ is in the open there is nothing to measure.
    this.root.hidden = Math.min(clearing.clientWidth, clearing.clientHeight) < SIZE;
    const seen = camera.matrixWorldInverse.clone().multiply(stage.world.matrixWorld);
    const width = Math.min(LONGEST, 0.3 * canvas.clientWidth);
    const now = `${seen.elements.map((x) => x.toPrecision(5)).join()} ${camera.fov} ${canvas.clientHeight}`;
    if (now === this.drawn || width === 0) return;
    this.drawn = now;
    this.arms.forEach((arm) => arm.turn(seen));
    const depth = -new THREE.Vector3(...stage.centre).applyMatrix4(seen).z;
    const pixels = canvas.clientHeight / (2 * depth * Math.tan(0.5 * camera.fov * THREE.MathUtils.DEG2RAD)) / stage.diagonal;
    const longest = width / pixels;
    // The longest round length that fits; ticks end at the first that does not.
    const ticks = scale(1000 * longest, 2);
    const fits = ticks.filter(({ value }) => value > 0 && value <= 1000 * longest * (1 + 1e-9)).at(-1) ?? ticks[1]!;
    this.bar.style.width = `${(fits.value / 1000) * pixels}px`;
    this.bar.dataset.metres = String(fits.value / 1000);
    this.bar.textContent = `${fits.text} mm`;
  }
}

/** One end of an axis. */
class Arm {
  at: [number, number] = [0, 0];
  private readonly line = document.createElementNS(SVG, "line");
  private readonly text = document.createElementNS(SVG, "text");

  constructor(
    svg: SVGElement,
    private readonly unit: THREE.Vector3,
    readonly letter: string,
    colour: string,
  ) {
    this.line.setAttribute("stroke", colour);
    this.text.textContent = letter;
    svg.append(this.line, this.text);
  }

  turn(seen: THREE.Matrix4): void {
    const { x, y, z } = this.unit.clone().transformDirection(seen);
    this.at = [x, y];
    const reach = 0.34 * SIZE;
    this.line.setAttribute("x2", String(reach * x));
    this.line.setAttribute("y2", String(-reach * y));
    this.text.setAttribute("x", String((reach + 6) * x));
    this.text.setAttribute("y", String(-(reach + 6) * y));
    // What points away from the viewer is paler.
    for (const part of [this.line, this.text]) part.style.opacity = z < -0.35 ? "0.4" : "1";
  }
}
