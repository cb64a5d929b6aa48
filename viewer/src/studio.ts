// The light that the organ mirrors: a small painted studio, cheap enough for any device.
import * as THREE from "three";

const [WIDTH, HEIGHT] = [128, 64];

/** A soft lamp: direction in degrees (around, above the horizon), half its size, brightness. */
const LAMPS = [
  { around: 40, above: 48, reach: 22, light: 8 },
  { around: 150, above: 35, reach: 18, light: 3.5 },
  { around: -95, above: 20, reach: 26, light: 2 },
  { around: -30, above: 70, reach: 20, light: 4.5 },
] as const;

/** The environment of a scene with z or y upright alike: bright above, warm below, four lamps. */
export function studio(renderer: THREE.WebGLRenderer): THREE.Texture {
  const pixels = new Float32Array(4 * WIDTH * HEIGHT);
  for (let row = 0; row < HEIGHT; row++) {
    const above = 90 - (180 * (row + 0.5)) / HEIGHT;
    for (let column = 0; column < WIDTH; column++) {
      const around = (360 * (column + 0.5)) / WIDTH - 180;
      const sky = 0.5 + 0.5 * Math.tanh(above / 35);
      const lamps = LAMPS.reduce((sum, lamp) => {
        const turn = ((around - lamp.around + 540) % 360) - 180;
        const off = Math.hypot(turn * Math.cos((above * Math.PI) / 180), above - lamp.above) / lamp.reach;
        return sum + lamp.light * Math.exp(-(off ** 2));
      }, 0);
      const at = 4 * (WIDTH * (HEIGHT - 1 - row) + column);
      pixels.set([0.3 + 0.55 * sky + lamps, 0.28 + 0.6 * sky + lamps, 0.27 + 0.68 * sky + 1.04 * lamps, 1], at);
    }
  }
  const painted = new THREE.DataTexture(pixels, WIDTH, HEIGHT, THREE.RGBAFormat, THREE.FloatType);
  painted.mapping = THREE.EquirectangularReflectionMapping;
  painted.minFilter = painted.magFilter = THREE.LinearFilter;
  painted.needsUpdate = true;
  const filter = new THREE.PMREMGenerator(renderer);
  const { texture } = filter.fromEquirectangular(painted);
  painted.dispose();
  filter.dispose();
  return texture;
}
