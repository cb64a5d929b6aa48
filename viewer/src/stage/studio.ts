// The light that the organ mirrors: a small painted studio, mirrored at every roughness. It is filtered here and not by
// three.js, whose filter makes more than a hundred million samples: seconds where graphics are drawn in software.
import * as THREE from "three";

/** Texels along an edge of the sharpest level; each further one has half as many. */
const SIZE = 64;
/** Samples of a texel of each level: the lobe widens, and the studio is smooth. */
const SAMPLES = [1, 32, 128, 128] as const;
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

/** A soft lamp: direction in degrees (around, above the horizon), half its size, brightness. */
const LAMPS = [
  { around: 40, above: 48, reach: 22, light: 8 },
  { around: 150, above: 35, reach: 18, light: 3.5 },
  { around: -95, above: 20, reach: 26, light: 2 },
  { around: -30, above: 70, reach: 20, light: 4.5 },
] as const;

type Direction = readonly [number, number, number];

/** The six faces of a cube texture, by their columns u and rows v from -1 to 1; three.js mirrors x. */
const FACES: readonly ((u: number, v: number) => Direction)[] = [
  (u, v) => [-1, -v, -u],
  (u, v) => [1, -v, u],
  (u, v) => [-u, 1, v],
  (u, v) => [-u, -1, -v],
  (u, v) => [-u, -v, 1],
  (u, v) => [u, -v, -1],
];

/** The environment of a scene with z or y upright alike: bright above, warm below, four lamps. */
export function studio(): THREE.Texture {
  const painted = paint();
  const levels = SAMPLES.map((samples, level) => {
    // As the materials of three.js read them.
    const roughness = 1 - Math.sqrt(1 - level / (SAMPLES.length - 1));
    const lobe = lobeOf(roughness, samples);
    return cube(FACES.map((at) => face(SIZE >> level, (u, v) => mirrored(normalized(at(u, v)), lobe, painted))));
  });
  const [sharpest, ...others] = levels as [THREE.CubeTexture, ...THREE.CubeTexture[]];
  // Of a cube's levels three.js counts the last one as the end of the mirrors.
  const end = cube(FACES.map(() => face(SIZE >> SAMPLES.length, () => [0, 0, 0])));
  sharpest.mipmaps = [...others, end];
  sharpest.minFilter = THREE.LinearMipmapLinearFilter;
  sharpest.isPMREMTexture = true;
  sharpest.needsUpdate = true;
  return sharpest;
}

/** Red, green and blue of the texels of the sharpest level, face by face: what the lobes of all levels gather from. */
function paint(): Float64Array {
  const painted = new Float64Array(3 * FACES.length * SIZE * SIZE);
  FACES.forEach((at, index) => {
    for (let k = 0; k < SIZE * SIZE; k++) {
      painted.set(radiance(normalized(at(...placeOf(k, SIZE)))), 3 * (index * SIZE * SIZE + k));
    }
  });
  return painted;
}

/** Where the k-th texel of a face lies. */
function placeOf(k: number, size: number): [number, number] {
  return [(2 * (k % size) + 1) / size - 1, (2 * Math.floor(k / size) + 1) / size - 1];
}

/** The texel of the sharpest level, counted over all faces, that a direction meets. */
function texelAlong(x: number, y: number, z: number): number {
  const [a, b, c] = [Math.abs(x), Math.abs(y), Math.abs(z)];
  if (a >= b && a >= c) return x < 0 ? texel(0, -z / a, -y / a) : texel(1, z / a, -y / a);
  if (b >= c) return y > 0 ? texel(2, -x / b, z / b) : texel(3, -x / b, -z / b);
  return z > 0 ? texel(4, -x / c, -y / c) : texel(5, x / c, -y / c);
}

function texel(index: number, u: number, v: number): number {
  const along = (place: number) => Math.min(Math.floor(((place + 1) * SIZE) / 2), SIZE - 1);
  return (index * SIZE + along(v)) * SIZE + along(u);
}

/** What comes from a direction: red, green, blue. */
function radiance([x, y, z]: Direction): Direction {
  const above = (180 / Math.PI) * Math.asin(Math.min(Math.max(y, -1), 1));
  const around = (180 / Math.PI) * Math.atan2(z, x);
  const sky = 0.5 + 0.5 * Math.tanh(above / 35);
  const lamps = LAMPS.reduce((sum, lamp) => {
    const turn = ((around - lamp.around + 540) % 360) - 180;
    const off = Math.hypot(turn * Math.hypot(x, z), above - lamp.above) / lamp.reach;
    return sum + lamp.light * Math.exp(-(off ** 2));
  }, 0);
  return [0.3 + 0.55 * sky + lamps, 0.28 + 0.6 * sky + lamps, 0.27 + 0.68 * sky + 1.04 * lamps];
}

/** Directions about the normal z of a surface of GGX that is looked at from there, each as bright as its cosine. */
function lobeOf(roughness: number, samples: number): Direction[] {
  const squared = roughness ** 4;
  const lobe: Direction[] = [];
  for (let k = 0; k < samples; k++) {
    const part = (k + 0.5) / samples;
    const scale = 1 / (1 - part + squared * part);
    const cosine = (1 - part - squared * part) * scale;
    if (cosine <= 0) continue;
    const sine = 2 * roughness ** 2 * Math.sqrt(part * (1 - part)) * scale;
    lobe.push([sine * Math.cos(k * GOLDEN_ANGLE), sine * Math.sin(k * GOLDEN_ANGLE), cosine]);
  }
  return lobe;
}

/** What a surface with this normal mirrors. */
function mirrored(normal: Direction, lobe: readonly Direction[], painted: Float64Array): Direction {
  const [x, y, z] = normal;
  const [a, b, c] = normalized(Math.abs(z) < 0.9 ? [y, -x, 0] : [0, z, -y]);
  const side = [y * c - z * b, z * a - x * c, x * b - y * a] as const;
  const sum: [number, number, number] = [0, 0, 0];
  let weight = 0;
  for (const [along, across, up] of lobe) {
    const from = texelAlong(
      up * x + along * a + across * side[0],
      up * y + along * b + across * side[1],
      up * z + along * c + across * side[2],
    );
    for (let i = 0; i < 3; i++) sum[i]! += up * painted[3 * from + i]!;
    weight += up;
  }
  return [sum[0] / weight, sum[1] / weight, sum[2] / weight];
}

function normalized([x, y, z]: Direction): Direction {
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

function face(size: number, at: (u: number, v: number) => Direction): THREE.DataTexture {
  const texels = new Uint16Array(4 * size * size);
  for (let k = 0; k < size * size; k++) {
    texels.set([...at(...placeOf(k, size)), 1].map(THREE.DataUtils.toHalfFloat), 4 * k);
  }
  return new THREE.DataTexture(texels, size, size, THREE.RGBAFormat, THREE.HalfFloatType);
}

function cube(faces: THREE.DataTexture[]): THREE.CubeTexture {
  const texture = new THREE.CubeTexture(faces, THREE.CubeReflectionMapping);
  texture.type = THREE.HalfFloatType;
  texture.magFilter = THREE.LinearFilter;
  texture.generateMipmaps = false;
  return texture;
}
