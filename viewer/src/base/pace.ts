// How fast it goes: frames a second while something moves, and means over the last frames of what takes time in them.

/** So many of the display's frames without a drawn one, and nothing moves. */
const PAUSE = 12;
const FRAMES = 60;

export class Pace {
  private readonly times: number[] = [];
  private idle = 0;

  /** A frame of the display at a time [ms], drawn anew or not. */
  tick(time: number, isDrawn: boolean): void {
    if (isDrawn && this.isAtRest) this.times.length = 0;
    this.idle = isDrawn ? 0 : this.idle + 1;
    if (!isDrawn) return;
    this.times.push(time);
    if (this.times.length > FRAMES) this.times.shift();
  }

  /** Whether nothing has moved for a while. */
  get isAtRest(): boolean {
    return this.idle > PAUSE;
  }

  /** Frames a second of the last motion; 0 before there are three in a row. */
  get rate(): number {
    const { times } = this;
    return times.length > 2 ? (1000 * (times.length - 1)) / (times.at(-1)! - times[0]!) : 0;
  }
}

/** A mean that forgets; clocks of browsers are coarse, single readings of them worthless. */
export class Mean {
  value = 0;
  private weight = 0;

  add(reading: number): void {
    this.weight = Math.min(this.weight + 1, 30);
    this.value += (reading - this.value) / this.weight;
  }
}

/** What is shown of them; a part that the browser's clock does not resolve is left out. */
export function paceInWords(rate: number, parts: readonly [string, number][]): string {
  const shown = parts.filter(([, ms]) => ms > 0).map(([name, ms]) => `${name} ${ms < 10 ? ms.toFixed(1) : ms.toFixed(0)} ms`);
  return [...(rate > 0 ? [`${rate.toFixed(0)} frames/s`] : []), ...shown].join(" · ");
}
