// Round numbers along a scale, written with the digits they need.

/** A mark on a scale: where, and what is written there. */
export interface Tick {
  value: number;
  text: string;
}

/** Ticks from 0 to the first round number at or beyond a largest value, in at most so many steps of 1, 2, 2.5 or 5. */
export function scale(largest: number, steps: number): Tick[] {
  const high = Number.isFinite(largest) && largest > 0 ? largest : 1;
  const power = 10 ** Math.floor(Math.log10(high / steps));
  // One part in a billion is rounding, not a reason for another step.
  const mantissa = [1, 2, 2.5, 5, 10].find((m) => m * power * steps >= high * (1 - 1e-9)) ?? 10;
  const step = mantissa * power;
  const decimals = Math.max(0, (mantissa === 2.5 ? 1 : 0) - Math.round(Math.log10(mantissa === 10 ? 10 * power : power)));
  const count = Math.ceil((high / step) * (1 - 1e-9));
  return Array.from({ length: count + 1 }, (_, k) => ({ value: k * step, text: (k * step).toFixed(k ? decimals : 0) }));
}
