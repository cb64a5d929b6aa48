// The force against the depth along the direction of the moment, one line for each order.
import type { Evaluator, Vec3 } from "./evaluator";

const SAMPLES = 48;
const MARGIN = { left: 34, right: 10, top: 10, bottom: 24 };

/** What is drawn: depths [m], the force [N] of every order there, and whether it is to be trusted. */
export interface Curves {
  depths: number[];
  forces: number[][];
  isTrusted: boolean[];
}

/** Samples the answers along a direction to the model's depth; the contact must be touched. */
export function sample(evaluator: Evaluator, direction: Vec3): Curves {
  const { depth, order } = evaluator.about.metadata;
  const depths = Array.from({ length: SAMPLES + 1 }, (_, k) => (k / SAMPLES) * depth);
  const along = (t: number) => direction.map((x) => t * x) as Vec3;
  const orders = Array.from({ length: order }, (_, p) => p + 1);
  const forces = orders.map((p) => depths.map((t) => Math.hypot(...evaluator.force(along(t), p))));
  const isTrusted = depths.map((t) => evaluator.evaluate(along(t)).trust === "trusted");
  return { depths, forces, isTrusted };
}

export class CurvePlot {
  private readonly context: CanvasRenderingContext2D;
  private top = 0;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.context = canvas.getContext("2d")!;
  }

  /** Draws the curves, the chosen order in front, and the state of the moment as a point. */
  draw(curves: Curves | null, order: number, depth: number, now: { depth: number; force: number } | null): void {
    const { canvas, context } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = Math.min(window.devicePixelRatio, 3);
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(canvas);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const best = curves?.forces[curves.forces.length - 1];
    this.top = nice(Math.max(best ? Math.max(...best) : 1, 1e-6) * 1.15);
    const x = (t: number) => MARGIN.left + (t / depth) * (width - MARGIN.left - MARGIN.right);
    const y = (f: number) => height - MARGIN.bottom - (f / this.top) * (height - MARGIN.top - MARGIN.bottom);
    context.font = `11px ${style.fontFamily}`;
    this.axes(width, height, depth, x, y, colour);
    if (!curves) return;
    context.save();
    context.beginPath();
    context.rect(MARGIN.left, MARGIN.top - 4, width - MARGIN.left - MARGIN.right + 4, height - MARGIN.top - MARGIN.bottom + 4);
    context.clip();
    context.fillStyle = colour("--doubt");
    const step = depth / SAMPLES;
    curves.isTrusted.forEach((trusted, k) => {
      const from = x(curves.depths[k]! - 0.5 * step);
      if (!trusted) context.fillRect(from, 0, x(curves.depths[k]! + 0.5 * step) - from, height);
    });
    const inFront = (p: number) => p === order - 1;
    const lines = curves.forces.map((_, p) => p).sort((a, b) => Number(inFront(a)) - Number(inFront(b)));
    for (const p of lines) {
      context.beginPath();
      curves.forces[p]!.forEach((f, k) => context.lineTo(x(curves.depths[k]!), y(f)));
      context.lineWidth = inFront(p) ? 2.5 : 1.25;
      context.strokeStyle = inFront(p) ? colour("--accent") : colour("--line");
      context.stroke();
    }
    context.restore();
    if (now) {
      context.beginPath();
      context.arc(x(Math.min(now.depth, depth)), y(Math.min(now.force, this.top)), 4.5, 0, 2 * Math.PI);
      context.fillStyle = colour("--accent");
      context.fill();
      context.lineWidth = 2;
      context.strokeStyle = colour("--panel-solid");
      context.stroke();
    }
  }

  private axes(
    width: number,
    height: number,
    depth: number,
    x: (t: number) => number,
    y: (f: number) => number,
    colour: (name: string) => string,
  ): void {
    const { context } = this;
    context.strokeStyle = colour("--grid");
    context.fillStyle = colour("--muted");
    context.lineWidth = 1;
    context.textBaseline = "middle";
    context.textAlign = "right";
    for (let k = 0; k <= 2; k++) {
      const f = (k / 2) * this.top;
      line(context, x(0), y(f), width - MARGIN.right, y(f));
      context.fillText(short(f), MARGIN.left - 6, y(f));
    }
    context.textAlign = "center";
    const step = nice(depth / 3) * 1000;
    for (let t = 0; t < 1000 * depth - 0.3 * step; t += step) context.fillText(short(t), x(t / 1000), height - MARGIN.bottom + 13);
    context.textAlign = "right";
    context.fillText("mm", width - 2, height - MARGIN.bottom + 13);
    context.textAlign = "left";
    context.fillText("N", MARGIN.left + 4, MARGIN.top + 2);
  }
}

function line(context: CanvasRenderingContext2D, x0: number, y0: number, x1: number, y1: number): void {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

/** The next round number. */
function nice(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return ([1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find((m) => m * power >= value * (1 - 1e-9)) ?? 10) * power;
}

function short(value: number): string {
  return String(Number(value.toPrecision(2)));
}
