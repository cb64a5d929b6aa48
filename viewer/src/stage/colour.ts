// Colour maps as short tables, interpolated linearly; and the gradient of a legend.
export type Rgb = [number, number, number];
export type ColourMap = readonly Rgb[];

const table = (hex: string): ColourMap =>
  hex.split(" ").map((code) => [0, 2, 4].map((at) => parseInt(code.slice(at, at + 2), 16) / 255) as Rgb);

/** Perceptually uniform: viridis, plasma, inferno without its black end; and a diverging map around zero. */
export const VIRIDIS = table("440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725");
export const INFERNO = table("2a0b52 550f6d 88226a b32a5c d84b40 f0701e fca50a f6d746 fcffa4");
export const PLASMA = table("0d0887 47039f 7301a8 9c179e bd3786 d8576b ed7953 fa9e3b fdc926 f0f921");
export const DIVERGING = table("2166ac 4393c3 92c5de d1e5f0 f4f1ee fddbc7 f4a582 d6604d b2182b");

/** The colour at t in [0, 1], sRGB, written to `out`. */
export function colourAt(map: ColourMap, t: number, out: Rgb): Rgb {
  const place = Math.min(Math.max(t, 0), 1) * (map.length - 1);
  const k = Math.min(Math.floor(place), map.length - 2);
  const [low, high] = [map[k] as Rgb, map[k + 1] as Rgb];
  for (let i = 0; i < 3; i++) out[i] = low[i]! + (place - k) * (high[i]! - low[i]!);
  return out;
}

/** sRGB to the linear values that lighting works with. */
export function linear(value: number): number {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

/** As CSS has it. */
export function css(rgb: Rgb): string {
  return `rgb(${rgb.map((x) => Math.round(255 * x)).join(" ")})`;
}

/** A CSS gradient from low to high. */
export function gradient(map: ColourMap, direction: string): string {
  return `linear-gradient(${direction}, ${map.map(css).join(", ")})`;
}
