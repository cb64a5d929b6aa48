// The drawn surface: every triangle of the mesh cut into four or sixteen along curved edges, so that a coarse mesh looks
// as smooth as the organ is. Nodes stay where they are, and sharp edges stay sharp. Curves are those of PN triangles:
//   middle of an edge ab = (a + b)/2 - [((b - a).n_a) n_a + ((a - b).n_b) n_b] / 8.

/** Edges sharper than this stay so. */
const CREASE = Math.cos((40 * Math.PI) / 180);

/** One refinement: edges by their ends, which of them are sharp, and the triangles that come out. */
interface Level {
  edges: Uint32Array;
  isSharp: Uint8Array;
  triangles: Uint32Array;
}

export class Skin {
  /** Drawn vertices (v, 3): positions [m] and normals; and triangles between them. */
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly triangles: Uint32Array;
  /** Node of each vertex of the mesh; nodes on a sharp edge have one vertex for each side. */
  private readonly nodes: Uint32Array;
  private readonly base: Uint32Array;
  private readonly levels: Level[] = [];

  constructor(rest: Float32Array, triangles: Uint32Array) {
    const sharp = sharpEdges(rest, triangles);
    const split = splitVertices(triangles, sharp);
    this.nodes = split.nodes;
    this.base = split.triangles;
    let isSharp = (a: number, b: number) => sharp.has(pair(this.nodes[a]!, this.nodes[b]!));
    let [count, current] = [this.nodes.length, this.base];
    const depth = triangles.length / 3 < 4000 ? 2 : triangles.length / 3 < 20000 ? 1 : 0;
    for (let k = 0; k < depth; k++) {
      const { level, isChildSharp } = refine(current, count, isSharp);
      this.levels.push(level);
      count += level.isSharp.length;
      current = level.triangles;
      isSharp = isChildSharp;
    }
    this.triangles = current;
    this.positions = new Float32Array(3 * count);
    this.normals = new Float32Array(3 * count);
    this.shape(rest);
  }

  /** Takes the shape in which the nodes are at these positions (s, 3). */
  shape(nodes: Float32Array): void {
    const { positions: x, normals: n } = this;
    this.nodes.forEach((node, v) => copy3(nodes, node, x, v));
    smoothNormals(x, this.base, n, this.nodes.length);
    let count = this.nodes.length;
    for (const { edges, isSharp, triangles } of this.levels) {
      for (let e = 0; e < isSharp.length; e++) {
        const [a, b, m] = [3 * edges[2 * e]!, 3 * edges[2 * e + 1]!, 3 * (count + e)];
        const [dx, dy, dz] = [x[b]! - x[a]!, x[b + 1]! - x[a + 1]!, x[b + 2]! - x[a + 2]!];
        const bend = isSharp[e] ? 0 : 0.125;
        const toA = bend * (dx * n[a]! + dy * n[a + 1]! + dz * n[a + 2]!);
        const toB = -bend * (dx * n[b]! + dy * n[b + 1]! + dz * n[b + 2]!);
        for (let i = 0; i < 3; i++) x[m + i] = 0.5 * (x[a + i]! + x[b + i]!) - toA * n[a + i]! - toB * n[b + i]!;
      }
      count += isSharp.length;
      smoothNormals(x, triangles, n, count);
    }
  }

  /** Carries triples of the nodes (s, 3) over to the vertices (v, 3). */
  spread(values: Float32Array, out: Float32Array): void {
    this.nodes.forEach((node, v) => copy3(values, node, out, v));
    let count = this.nodes.length;
    for (const { edges, isSharp } of this.levels) {
      for (let e = 0; e < isSharp.length; e++) {
        const [a, b, m] = [3 * edges[2 * e]!, 3 * edges[2 * e + 1]!, 3 * (count + e)];
        for (let i = 0; i < 3; i++) out[m + i] = 0.5 * (out[a + i]! + out[b + i]!);
      }
      count += isSharp.length;
    }
  }

  /** The triangle of the mesh that a drawn one is a part of. */
  parent(triangle: number): number {
    return triangle >> (2 * this.levels.length);
  }
}

/** Sums of the normals of adjacent triangles, which area weighs, for the first vertices. */
function smoothNormals(x: Float32Array, triangles: Uint32Array, out: Float32Array, count: number): void {
  out.fill(0, 0, 3 * count);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!];
    const [ux, uy, uz] = [x[b]! - x[a]!, x[b + 1]! - x[a + 1]!, x[b + 2]! - x[a + 2]!];
    const [vx, vy, vz] = [x[c]! - x[a]!, x[c + 1]! - x[a + 1]!, x[c + 2]! - x[a + 2]!];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const row of [a, b, c]) {
      out[row]! += nx;
      out[row + 1]! += ny;
      out[row + 2]! += nz;
    }
  }
  for (let row = 0; row < 3 * count; row += 3) {
    const size = Math.sqrt(out[row]! ** 2 + out[row + 1]! ** 2 + out[row + 2]! ** 2) || 1;
    for (let i = 0; i < 3; i++) out[row + i]! /= size;
  }
}

/** Pairs of nodes between two triangles that meet at a sharp angle. */
function sharpEdges(rest: Float32Array, triangles: Uint32Array): Set<number> {
  const seen = new Map<number, [number, number, number]>();
  const sharp = new Set<number>();
  for (let t = 0; t < triangles.length; t += 3) {
    const normal = normalOf(rest, triangles, t);
    for (let k = 0; k < 3; k++) {
      const edge = pair(triangles[t + k]!, triangles[t + ((k + 1) % 3)]!);
      const other = seen.get(edge);
      if (!other) seen.set(edge, normal);
      else if (normal[0] * other[0] + normal[1] * other[1] + normal[2] * other[2] < CREASE) sharp.add(edge);
    }
  }
  return sharp;
}

function normalOf(x: Float32Array, triangles: Uint32Array, t: number): [number, number, number] {
  const [a, b, c] = [3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!];
  const [ux, uy, uz] = [x[b]! - x[a]!, x[b + 1]! - x[a + 1]!, x[b + 2]! - x[a + 2]!];
  const [vx, vy, vz] = [x[c]! - x[a]!, x[c + 1]! - x[a + 1]!, x[c + 2]! - x[a + 2]!];
  const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx] as const;
  const size = Math.hypot(...normal) || 1;
  return [normal[0] / size, normal[1] / size, normal[2] / size];
}

/** One vertex for each fan of triangles around a node that no sharp edge divides. */
function splitVertices(triangles: Uint32Array, sharp: Set<number>): { nodes: Uint32Array; triangles: Uint32Array } {
  // Corners of triangles are joined across every edge that is not sharp.
  const leader = Uint32Array.from({ length: triangles.length }, (_, corner) => corner);
  const find = (corner: number): number => {
    while (leader[corner] !== corner) corner = leader[corner] = leader[leader[corner]!]!;
    return corner;
  };
  const across = new Map<number, [number, number]>();
  for (let t = 0; t < triangles.length; t += 3) {
    for (let k = 0; k < 3; k++) {
      const [from, to] = [t + k, t + ((k + 1) % 3)];
      const edge = pair(triangles[from]!, triangles[to]!);
      if (sharp.has(edge)) continue;
      const other = across.get(edge);
      if (!other) {
        across.set(edge, [from, to]);
        continue;
      }
      for (const corner of [from, to]) {
        const match = other.find((c) => triangles[c] === triangles[corner]);
        if (match !== undefined) leader[find(corner)] = find(match);
      }
    }
  }
  const vertex = new Map<number, number>();
  const nodes: number[] = [];
  const corners = triangles.map((node, corner) => {
    const fan = find(corner);
    let v = vertex.get(fan);
    if (v === undefined) {
      v = nodes.push(node) - 1;
      vertex.set(fan, v);
    }
    return v;
  });
  return { nodes: Uint32Array.from(nodes), triangles: corners };
}

/** Cuts every triangle into four; triangle t becomes 4t to 4t + 3. */
function refine(triangles: Uint32Array, count: number, isSharp: (a: number, b: number) => boolean) {
  const middles = new Map<number, number>();
  const edges: number[] = [];
  const sharp: number[] = [];
  const children = new Set<number>();
  const middle = (a: number, b: number): number => {
    const edge = pair(a, b);
    let m = middles.get(edge);
    if (m === undefined) {
      m = count + sharp.length;
      middles.set(edge, m);
      edges.push(a, b);
      sharp.push(Number(isSharp(a, b)));
      if (isSharp(a, b)) children.add(pair(a, m)).add(pair(b, m));
    }
    return m;
  };
  const out = new Uint32Array(4 * triangles.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t]!, triangles[t + 1]!, triangles[t + 2]!];
    const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
    out.set([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], 4 * t);
  }
  const level: Level = { edges: Uint32Array.from(edges), isSharp: Uint8Array.from(sharp), triangles: out };
  return { level, isChildSharp: (a: number, b: number) => children.has(pair(a, b)) };
}

/** Two numbers below 2^26 as one, whatever comes first. */
function pair(a: number, b: number): number {
  return a < b ? a * 67108864 + b : b * 67108864 + a;
}

function copy3(from: Float32Array, i: number, to: Float32Array, j: number): void {
  to[3 * j] = from[3 * i]!;
  to[3 * j + 1] = from[3 * i + 1]!;
  to[3 * j + 2] = from[3 * i + 2]!;
}
