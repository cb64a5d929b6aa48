// Where the organ is seen: renderer, camera, light, and a frame only when something has changed.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { element } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { Mean, Pace } from "../base/pace";
import { studio } from "./studio";

/** Field of view at the least [degrees]; where one organ is looked at from [diagonals], and how much wider than it is. */
const FIELD = 32;
const DISTANCE = 1.85;
const MARGIN = 1.12;
/** The organ is drawn as large as in a clearing of this size at the least [px]. */
const LEAST = 48;
/** A view that is no farther from the first one is that [diagonals]: controls round. */
const ROUNDING = 1e-6;
/** How close the view comes to the axis that is upright when keys turn it [rad]. */
const CLOSEST = 0.02;
/** What is said until the browser gives the drawing back. */
export const CONTEXT_LOST = "The browser has released the graphics processor. The organ comes back with it; if it does not, reload the page.";
/** Below so many frames a second pixels are saved; the share of them that is left along each side. */
const SLUGGISH = 20;
const COARSE = 0.5;

/** The view's lengths are organ diagonals, so that light, camera and controls suit every organ. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(FIELD, 1, 0.02, 60);
  /** Holds the organ; its children are in metres. */
  readonly world = new THREE.Group();
  readonly controls: OrbitControls;
  /** Work after a frame has been drawn, while the drawing is there. */
  onDrawn: () => void = () => {};
  /** Work of every frame, before it is drawn; given the seconds since the last. */
  onFrame: (seconds: number) => void = () => {};
  /** Work of every frame in a headset. */
  onHeadset: () => void = () => {};
  readonly pace = new Pace();
  /** Milliseconds of a frame for shaping and drawing what is seen. */
  readonly drawing = new Mean();

  /** The part of the view that no panel takes: there the organ stands. */
  readonly clearing = element("div", { class: "clearing" });
  /** The browser has released the graphics processor, or given it back. */
  onContext: (isLost: boolean) => void = () => {};

  private isStale = true;
  /** The clearing, or the canvas itself, is of another size than when the organ was fitted to it. */
  private isMisfit = true;
  private isStretched = true;
  private last = 0;
  private shaping = 0;
  /** Whether it is drawn with fewer pixels than the screen has. */
  private isCoarse = false;
  private room = 1;
  private shapes: readonly Placed[] = [];
  private readonly home = new THREE.Vector3();
  /** What the first view looks at, from the organ's middle at rest [diagonals]. */
  private readonly focus = new THREE.Vector3();
  private readonly observer: ResizeObserver;
  private readonly abort = new AbortController();

  /** Throws a sentence where the browser cannot draw. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    readonly centre: Vec3,
    readonly diagonal: number,
    facing: Vec3,
  ) {
    this.renderer = new THREE.WebGLRenderer({ canvas, context: drawingContext(canvas) });
    this.renderer.setPixelRatio(this.fullRatio);
    this.renderer.toneMapping = THREE.NeutralToneMapping;
    this.renderer.toneMappingExposure = 1;
    this.light();
    this.world.scale.setScalar(1 / diagonal);
    this.world.position.set(...centre).multiplyScalar(-1 / diagonal);
    this.scene.add(this.world);
    this.camera.up.set(0, 0, 1);
    this.home.copy(viewpoint(facing)).multiplyScalar(DISTANCE);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.minDistance = 0.5;
    this.controls.maxDistance = 8;
    this.controls.addEventListener("change", () => this.invalidate());
    this.observer = new ResizeObserver((changes) => {
      this.isMisfit = true;
      this.isStretched ||= changes.some(({ target }) => target === canvas);
    });
    this.observer.observe(canvas);
    this.observer.observe(this.clearing);
    const { signal } = this.abort;
    canvas.addEventListener("webglcontextlost", () => this.onContext(true), { signal });
    canvas.addEventListener("webglcontextrestored", () => this.resume(), { signal });
    this.goHome();
    this.renderer.setAnimationLoop((time) => this.frame(time));
  }

  /** Back to the first view. */
  goHome(): void {
    this.camera.position.copy(this.outlook);
    this.controls.target.copy(this.focus);
    this.controls.update();
    this.invalidate();
  }

  /** Whether the organ is looked at as in the first view. */
  get isHome(): boolean {
    const off = this.camera.position.distanceTo(this.outlook) + this.controls.target.distanceTo(this.focus);
    return off < ROUNDING;
  }

  /** Where the first view is looked at from [diagonals]. */
  private get outlook(): THREE.Vector3 {
    return this.home.clone().multiplyScalar(this.room).add(this.focus);
  }

  /** Looks at the organ from a place [diagonals]. */
  lookFrom(place: Vec3): void {
    this.camera.position.set(...place);
    this.controls.update();
    this.invalidate();
  }

  /** Goes round what is looked at, to the right and up [rad]; a hand that holds on keeps the view. */
  turn(right: number, up: number): void {
    if (!this.controls.enabled) return;
    const { target } = this.controls;
    const off = this.camera.position.clone().sub(target);
    const pole = this.camera.up;
    const [low, high] = [CLOSEST - off.angleTo(pole), Math.PI - CLOSEST - off.angleTo(pole)];
    const axis = new THREE.Vector3().crossVectors(pole, off).normalize();
    off.applyAxisAngle(axis, Math.min(Math.max(-up, low), high)).applyAxisAngle(pole, right);
    this.lookFrom(off.add(target).toArray());
  }

  /** Comes closer to what is looked at by a factor, as far as the controls allow. */
  zoom(factor: number): void {
    if (!this.controls.enabled) return;
    const { target } = this.controls;
    this.lookFrom(this.camera.position.clone().sub(target).divideScalar(factor).add(target).toArray());
  }

  /** Direction of the first view, from the organ to the viewer. */
  get towards(): Vec3 {
    return this.home.toArray();
  }

  /** Direction to the right in the first view. */
  get right(): Vec3 {
    return new THREE.Vector3().crossVectors(this.camera.up, this.home).normalize().toArray();
  }

  /** Takes these shapes into the first view, whole. */
  enclose(shapes: readonly Placed[]): void {
    this.shapes = shapes;
    const right = new THREE.Vector3(...this.right);
    const along = shapes.flatMap(({ points, at }) => {
      const [low, high] = extent(points, (x, y, z) => right.x * x + right.y * y + right.z * z);
      const offset = right.dot(new THREE.Vector3(...at));
      return [low + offset, high + offset];
    });
    this.room = Math.max(1, (Math.max(...along) - Math.min(...along)) / this.diagonal);
    this.focus.copy(middle(shapes)).sub(CENTRE.set(...this.centre)).divideScalar(this.diagonal);
    this.goHome();
    this.fit();
  }

  /** Fits the canvas to its place, and the organ to the clearing. */
  fit(): void {
    this.isMisfit = this.isStretched = false;
    const { canvas, camera, clearing } = this;
    const [width, height] = [Math.max(canvas.clientWidth, 1), Math.max(canvas.clientHeight, 1)];
    this.renderer.setSize(width, height, false);
    const [across, up] = this.slopes();
    // Pixels for a slope of one: so many that all is seen, and no more than on a wide screen.
    const [wide, high] = [Math.max(clearing.clientWidth, LEAST), Math.max(clearing.clientHeight, LEAST)];
    const fitting = Math.min(wide / across, high / up) / MARGIN;
    const pixels = Math.max(Math.min(0.5 * fitting, (0.5 * height) / Math.tan(0.5 * FIELD * THREE.MathUtils.DEG2RAD)), 1);
    camera.aspect = width / height;
    camera.fov = 2 * THREE.MathUtils.RAD2DEG * Math.atan((0.5 * height) / pixels);
    const shift = 0.5 * width - (clearing.offsetLeft + 0.5 * clearing.clientWidth);
    const drop = 0.5 * height - (clearing.offsetTop + 0.5 * clearing.clientHeight);
    camera.setViewOffset(width, height, shift, drop, width, height);
    camera.updateProjectionMatrix();
    this.invalidate();
  }

  /** Asks for a frame. */
  invalidate(): void {
    this.isStale = true;
  }

  /** Does what the next frame shows, and counts its time as part of that frame's. */
  shape(work: () => void): void {
    const began = performance.now();
    work();
    this.shaping += performance.now() - began;
    this.invalidate();
  }

  /** Takes over where things stand since they were last drawn. */
  place(): void {
    this.scene.updateMatrixWorld();
  }

  /** A point of the organ [m] on the canvas, in CSS pixels. */
  project(point: THREE.Vector3): { x: number; y: number } {
    this.place();
    return this.onCanvas(this.world.localToWorld(point.clone()));
  }

  /** A point of the scene on the canvas, in CSS pixels. */
  onCanvas(point: THREE.Vector3): { x: number; y: number } {
    const at = point.clone().project(this.camera);
    return { x: (0.5 + 0.5 * at.x) * this.canvas.clientWidth, y: (0.5 - 0.5 * at.y) * this.canvas.clientHeight };
  }

  /** Draws what is seen with all pixels, whatever moves: the next frame may have fewer again. A headset has its own. */
  drawSharply(): void {
    if (this.isCoarse && !this.renderer.xr.isPresenting) this.coarsen(false);
    this.renderer.render(this.scene, this.camera);
  }

  /** Pixels of the drawing for each CSS pixel, while none are saved. */
  get fullRatio(): number {
    return Math.min(window.devicePixelRatio, 2);
  }

  dispose(): void {
    this.renderer.setAnimationLoop(null);
    this.observer.disconnect();
    this.abort.abort();
    this.controls.dispose();
    this.renderer.dispose();
    // A browser allows few contexts; a notebook makes one for each cell that is run.
    this.renderer.forceContextLoss();
  }

  private light(): void {
    this.scene.environment = studio();
    this.scene.environmentIntensity = 0.32;
    // The studio is painted with y upright.
    this.scene.environmentRotation.x = Math.PI / 2;
    // Lamps travel with the camera, so no side of the organ is ever in the dark.
    const key = new THREE.DirectionalLight(0xfff4ea, 1.7);
    key.position.set(-1.2, 1.6, 1.4);
    const rim = new THREE.DirectionalLight(0xcfe0ff, 0.9);
    rim.position.set(2.2, 0.4, -1.6);
    this.camera.add(key, rim, key.target, rim.target);
    this.scene.add(this.camera);
  }

  /** What was in the memory of the graphics processor is drawn anew. */
  private resume(): void {
    this.onContext(false);
    this.invalidate();
  }

  /** How steep the rays to the outermost points of the first view are, to either side and up or down. */
  private slopes(): [number, number] {
    const eye = new THREE.PerspectiveCamera();
    eye.up.copy(this.camera.up);
    eye.position.copy(this.outlook);
    eye.lookAt(this.focus);
    eye.updateMatrixWorld();
    const point = new THREE.Vector3();
    let [across, up] = [0.1, 0.1];
    for (const { points, at } of this.shapes) {
      for (let n = 0; n < points.length; n += 3) {
        point.set(points[n]! + at[0], points[n + 1]! + at[1], points[n + 2]! + at[2]).sub(CENTRE.set(...this.centre));
        point.divideScalar(this.diagonal).applyMatrix4(eye.matrixWorldInverse);
        across = Math.max(across, Math.abs(point.x / point.z));
        up = Math.max(up, Math.abs(point.y / point.z));
      }
    }
    return [across, up];
  }

  /** Where drawing is slow, fewer pixels while something moves, and all of them once it rests. */
  private sharpen(): void {
    const { rate, isAtRest } = this.pace;
    const isCoarse = !isAtRest && (this.isCoarse || (rate > 0 && rate < SLUGGISH));
    if (isCoarse === this.isCoarse) return;
    this.coarsen(isCoarse);
    this.invalidate();
  }

  private coarsen(isCoarse: boolean): void {
    this.isCoarse = isCoarse;
    this.renderer.setPixelRatio((isCoarse ? COARSE : 1) * this.fullRatio);
  }

  private frame(time: number): void {
    const interval = time - this.last;
    this.last = time;
    const { isPresenting } = this.renderer.xr;
    // A panel that comes or goes waits while a hand holds on: what it holds would jump. A headset has a size of its own.
    if (!isPresenting && (this.isStretched || (this.isMisfit && this.controls.enabled))) this.fit();
    this.controls.update();
    this.onFrame(Math.min(interval, 100) / 1000);
    if (isPresenting) this.onHeadset();
    else this.sharpen();
    const isDrawn = this.isStale || isPresenting;
    this.pace.tick(time, isDrawn);
    if (!isDrawn) return;
    this.isStale = false;
    const began = performance.now();
    this.renderer.render(this.scene, this.camera);
    this.onDrawn();
    this.drawing.add(this.shaping + performance.now() - began);
    this.shaping = 0;
  }
}

/** A surface's points (s, 3) [m] and how far from its own place it stands [m]. */
export interface Placed {
  points: Float32Array;
  at: Vec3;
}

const CENTRE = new THREE.Vector3();

/** The least and the largest value over points. */
function extent(points: Float32Array, value: (x: number, y: number, z: number) => number): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (let n = 0; n < points.length; n += 3) {
    const at = value(points[n]!, points[n + 1]!, points[n + 2]!);
    [low, high] = [Math.min(low, at), Math.max(high, at)];
  }
  return [low, high];
}

/** The middle of the box about shapes [m]. */
function middle(shapes: readonly Placed[]): THREE.Vector3 {
  const ends = [0, 1, 2].map((i) => shapes.flatMap(({ points, at }) => extent(points, (...place) => place[i]!).map((x) => x + at[i]!)));
  return new THREE.Vector3(...ends.map((along) => 0.5 * (Math.min(...along) + Math.max(...along))));
}

/** What a canvas is drawn with; throws a sentence where the browser has no WebGL 2. */
function drawingContext(canvas: HTMLCanvasElement): WebGL2RenderingContext {
  const context = canvas.getContext("webgl2", { antialias: true, alpha: true, powerPreference: "default" });
  if (context) return context;
  throw new Error(
    "this browser offers no WebGL 2, with which the page draws; switch on hardware acceleration in its settings, or use another browser.",
  );
}

/** From where a surface that faces this way is seen best: a little from above and from the side. */
function viewpoint(facing: Vec3): THREE.Vector3 {
  const normal = new THREE.Vector3(...facing);
  if (normal.lengthSq() < 1e-12) normal.set(0, -1, 0);
  normal.normalize();
  // Not along the axis that the camera holds upright.
  const flat = new THREE.Vector3(normal.x, normal.y, 0);
  if (flat.lengthSq() < 0.04) flat.set(0.25, -1, 0);
  const height = Math.min(Math.max(normal.z + 0.35, -0.6), 0.8);
  return flat.normalize().multiplyScalar(Math.sqrt(1 - height * height)).setZ(height).applyAxisAngle(new THREE.Vector3(0, 0, 1), 0.6);
}
