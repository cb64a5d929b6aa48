// Where the organ is seen: renderer, camera, light, and a frame only when something has changed.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Vec3 } from "./evaluator";
import { Mean, Pace } from "./pace";
import { studio } from "./studio";

/** Field of view [degrees], and half the width that must be seen at the distance of 1. */
const FIELD = 32;
const HALF_WIDTH = 0.27;
/** From where one organ is looked at, and up to which width [px] the readings lie below it. */
const DISTANCE = 1.85;
const NARROW = 820;
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
  /** Work of every frame, before it is drawn; given the seconds since the last. */
  onFrame: (seconds: number) => void = () => {};
  readonly pace = new Pace();
  /** Milliseconds of a frame for shaping and drawing what is seen. */
  readonly drawing = new Mean();

  private isStale = true;
  private last = 0;
  private shaping = 0;
  /** Whether it is drawn with fewer pixels than the screen has. */
  private isCoarse = false;
  private room = 1;
  private readonly home = new THREE.Vector3();
  private readonly observer: ResizeObserver;

  constructor(
    readonly canvas: HTMLCanvasElement,
    readonly centre: Vec3,
    readonly diagonal: number,
    facing: Vec3,
  ) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
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
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(canvas.parentElement ?? canvas);
    this.goHome();
    this.resize();
    this.renderer.setAnimationLoop((time) => this.frame(time));
  }

  /** Back to the first view. */
  goHome(): void {
    this.camera.position.copy(this.home).multiplyScalar(this.room);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.invalidate();
  }

  /** Direction of the first view, from the organ to the viewer. */
  get towards(): Vec3 {
    return this.home.toArray();
  }

  /** Direction to the right in the first view. */
  get right(): Vec3 {
    return new THREE.Vector3().crossVectors(this.camera.up, this.home).normalize().toArray();
  }

  /** Makes room for organs side by side, together of this width [m]. */
  widen(width: number): void {
    const { fov, aspect } = this.camera;
    const free = this.canvas.clientWidth > NARROW ? 0.74 : 0.92;
    const seen = 2 * DISTANCE * Math.tan(0.5 * fov * THREE.MathUtils.DEG2RAD) * aspect * free;
    this.room = Math.max(1, width / this.diagonal / seen);
    this.goHome();
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

  /** A point of the organ [m] on the canvas, in CSS pixels. */
  project(point: THREE.Vector3): { x: number; y: number } {
    return this.onCanvas(this.world.localToWorld(point.clone()));
  }

  /** A point of the scene on the canvas, in CSS pixels. */
  onCanvas(point: THREE.Vector3): { x: number; y: number } {
    const at = point.clone().project(this.camera);
    return { x: (0.5 + 0.5 * at.x) * this.canvas.clientWidth, y: (0.5 - 0.5 * at.y) * this.canvas.clientHeight };
  }

  dispose(): void {
    this.renderer.setAnimationLoop(null);
    this.observer.disconnect();
    this.controls.dispose();
    this.renderer.dispose();
  }

  private light(): void {
    this.scene.environment = studio(this.renderer);
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

  private resize(): void {
    const frame = this.canvas.parentElement ?? this.canvas;
    const [width, height] = [Math.max(frame.clientWidth, 1), Math.max(frame.clientHeight, 1)];
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // On a narrow screen the organ must still fit; beside the readings it stands left of the middle.
    this.camera.fov = Math.max(FIELD, 2 * THREE.MathUtils.RAD2DEG * Math.atan(HALF_WIDTH / this.camera.aspect));
    const shift = width > NARROW ? 0.5 * Math.min(330, 0.3 * width) : 0;
    const drop = width > NARROW ? 0 : 0.13 * height;
    this.camera.setViewOffset(width, height, shift, drop, width, height);
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  /** Where drawing is slow, fewer pixels while something moves, and all of them once it rests. */
  private sharpen(): void {
    const { rate, isAtRest } = this.pace;
    const isCoarse = !isAtRest && (this.isCoarse || (rate > 0 && rate < SLUGGISH));
    if (isCoarse === this.isCoarse) return;
    this.isCoarse = isCoarse;
    this.renderer.setPixelRatio((isCoarse ? COARSE : 1) * Math.min(window.devicePixelRatio, 2));
    this.invalidate();
  }

  private frame(time: number): void {
    const interval = time - this.last;
    this.last = time;
    this.controls.update();
    this.onFrame(Math.min(interval, 100) / 1000);
    const { isPresenting } = this.renderer.xr;
    if (!isPresenting) this.sharpen();
    const isDrawn = this.isStale || isPresenting;
    this.pace.tick(time, isDrawn);
    if (!isDrawn) return;
    this.isStale = false;
    const began = performance.now();
    this.renderer.render(this.scene, this.camera);
    this.drawing.add(this.shaping + performance.now() - began);
    this.shaping = 0;
  }
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
