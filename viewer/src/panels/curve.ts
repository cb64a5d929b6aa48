// The force against the depth along the direction of the moment, one line for each order.
import { roomBeside } from "./doubt";
import type { Evaluator, Vec3 } from "../model/evaluator";
import { apart } from "../model/field";
import { scale, type Tick } from "../base/scale";

/** Samples to the model's depth. */
const SAMPLES = 40;
const MARGIN = { left: 34, right: 10, top: 10, bottom: 24 };
/** Steps between ticks at the most: of the force, and of the depth. */
const FORCE_STEPS = 3;
const DEPTH_STEPS = 4;

/** What is drawn: depths [m], the force [N] of every order there, and whether it is to be trusted. */
export interface Curves {
  depths: number[];
  forces: number[][];
  /** Estimated error of the highest order's force, relative to it. */
  errors: number[];
  isTrusted: boolean[][];
}

/** Samples the answers along a direction, to so many times the model's depth; the contact must be touched. */
export function sample(evaluator: Evaluator, direction: Vec3, times: number): Curves {
  const { metadata } = evaluator.about;
  const { depth, order } = metadata;
  const depths = Array.from({ length: Math.round(times * SAMPLES) + 1 }, (_, k) => (k / SAMPLES) * depth);
  const along = (t: number) => direction.map((x) => t * x) as Vec3;
  const orders = Array.from({ length: order }, (_, p) => p + 1);
  const forces = orders.map((p) => depths.map((t) => evaluator.force(along(t), p)));
  const answers = depths.map((t) => evaluator.evaluate(along(t)));
  const isWithin = (of: Vec3, k: number) => apart(of, answers[k]!.force) <= roomBeside(answers[k]!.error, depths[k]!, metadata, false);
  const isTrusted = forces.map((line, p) => line.map((of, k) => answers[k]!.trust === "trusted" && (p + 1 === order || isWithin(of, k))));
  const sizes = forces.map((line) => line.map((of) => Math.hypot(...of)));
  return { depths, forces: sizes, errors: answers.map(({ error }) => error), isTrusted };
}

/** What a plot shows: the curves, the chosen order, the model's depth [m], and the state of the moment. */
interface Drawing {
  curves: Curves | null;
  order: number;
  depth: number;
  now: { depth: number; force: number } | null;
}

/** From depths [m] and forces [N] to the canvas [px], and its size. */
interface Plane {
  width: number;
  height: number;
  left: number;
  x: (depth: number) => number;
  y: (force: number) => number;
}

export class CurvePlot {
  private readonly context: CanvasRenderingContext2D;
  private readonly observer: ResizeObserver;
  private drawing: Drawing | null = null;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.context = canvas.getContext("2d")!;
    this.observer = new ResizeObserver(() => this.redraw());
    this.observer.observe(canvas);
  }

  /** Draws the curves, the chosen order in front, and the state of the moment as a point. */
  draw(curves: Curves | null, order: number, depth: number, now: { depth: number; force: number } | null): void {
    this.drawing = { curves, order, depth, now };
    this.redraw();
  }

  /** Draws the same again: in another size, or in other colours. */
  redraw(): void {
    const { canvas, context, drawing } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!drawing || width === 0 || height === 0) return;
    const ratio = Math.min(window.devicePixelRatio, 3);
    const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(canvas);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    context.font = `11px ${style.fontFamily}`;
    const { curves, order, depth, now } = drawing;
    // What is touched now is seen where it is, also beyond what the model is made for, or far above the highest order.
    const deepest = Math.max(depth, now?.depth ?? 0);
    const seen = curves?.forces.at(-1)!.filter((_, k) => curves.depths[k]! <= deepest) ?? [1];
    const forces = scale(1.1 * Math.max(...seen, now?.force ?? 0, 1e-6), FORCE_STEPS);
    const left = Math.max(MARGIN.left, 10 + Math.max(...forces.map(({ text }) => context.measureText(text).width)));
    const top = forces.at(-1)!.value;
    const x = (t: number) => left + (t / deepest) * (width - left - MARGIN.right);
    const y = (f: number) => height - MARGIN.bottom - (f / top) * (height - MARGIN.top - MARGIN.bottom);
    const plane = { width, height, left, x, y };
    // Without a touch the scale of the force would be a guess.
    this.axes(plane, curves ? forces : forces.slice(0, 1), deepest, colour);
    if (curves) this.lines(plane, curves, order, colour);
    if (now) this.point(x(now.depth), y(now.force), colour);
  }

  dispose(): void {
    this.observer.disconnect();
  }

  private lines({ width, height, left, x, y }: Plane, curves: Curves, order: number, colour: (name: string) => string): void {
    const { context } = this;
    context.save();
    context.beginPath();
    context.rect(left, MARGIN.top - 4, width - left - MARGIN.right + 4, height - MARGIN.top - MARGIN.bottom + 4);
    context.clip();
    context.fillStyle = colour("--doubt");
    const half = 0.5 * (curves.depths[1]! - curves.depths[0]!);
    curves.isTrusted[order - 1]!.forEach((trusted, k) => {
      const from = x(curves.depths[k]! - half);
      if (!trusted) context.fillRect(from, 0, x(curves.depths[k]! + half) - from, height);
    });
    // The band within which the full solution is estimated to lie, where that is more than the width of a line.
    const best = curves.forces.length - 1;
    if (order - 1 === best) {
      const edge = (k: number, sign: number) => y(Math.max(0, curves.forces[best]![k]! * (1 + sign * curves.errors[k]!)));
      context.beginPath();
      curves.depths.forEach((t, k) => context.lineTo(x(t), edge(k, 1)));
      for (let k = curves.depths.length - 1; k >= 0; k--) context.lineTo(x(curves.depths[k]!), edge(k, -1));
      context.fillStyle = colour("--band");
      context.fill();
    }
    const inFront = (p: number) => p === order - 1;
    const orders = curves.forces.map((_, p) => p).sort((a, b) => Number(inFront(a)) - Number(inFront(b)));
    for (const p of orders) {
      context.beginPath();
      curves.forces[p]!.forEach((f, k) => context.lineTo(x(curves.depths[k]!), y(f)));
      context.lineWidth = inFront(p) ? 2.5 : 1.25;
      context.strokeStyle = inFront(p) ? colour("--accent") : colour("--line");
      context.stroke();
    }
    context.restore();
  }

  private point(x: number, y: number, colour: (name: string) => string): void {
    const { context } = this;
    context.beginPath();
    context.arc(x, y, 4.5, 0, 2 * Math.PI);
    context.fillStyle = colour("--accent");
    context.fill();
    context.lineWidth = 2;
    context.strokeStyle = colour("--panel");
    context.stroke();
  }

  private axes({ width, height, left, x, y }: Plane, forces: Tick[], depth: number, colour: (name: string) => string): void {
    const { context } = this;
    context.strokeStyle = colour("--grid");
    context.fillStyle = colour("--muted");
    context.lineWidth = 1;
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (const { value, text } of forces) {
      line(context, x(0), y(value), width - MARGIN.right, y(value));
      context.fillText(text, left - 6, y(value));
    }
    const below = height - MARGIN.bottom + 13;
    const unit = context.measureText("mm").width;
    context.fillText("mm", width - 2, below);
    context.textAlign = "center";
    for (const { value, text } of scale(1000 * depth, DEPTH_STEPS)) {
      const right = x(value / 1000) + 0.5 * context.measureText(text).width;
      if (right < width - unit - 6) context.fillText(text, x(value / 1000), below);
    }
    context.textAlign = "left";
    context.fillText("N", left + 4, MARGIN.top + 2);
  }
}

function line(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}
