// A case in real time: the stepper on this machine sends a frame for every request; one organ, or two laws side by side.
import * as THREE from "three";
import { Arrow } from "./arrow";
import { Body, lookOver, type Hit, type Surface } from "./body";
import { VIRIDIS } from "./colour";
import { button, choice, digits, element, fixed, newtons, Segments } from "./dom";
import type { Vec3 } from "./evaluator";
import { Legend } from "./legend";
import { Pointer, type Tool, type Touched } from "./pointer";
import { Stage } from "./stage";
import style from "./style.css?inline";

/** What the stepper says first (python/viscera/viewer/live.py). */
interface Hello {
  name: string;
  laws: string[];
  law: string;
  diagonal: number;
  radius: number;
  gravity: Vec3;
  rest: number[];
  triangles: number[];
}

type Request = { laws?: string[]; grab?: Vec3; move?: Vec3; release?: true; gravity?: Vec3 };

/** Numbers of a body in a frame before its displacements. */
const FACTS = 8;
/** Below this residual, with nobody touching, no more frames are asked for. */
const SETTLED = 1e-6;
const GRAVITIES: readonly [string, string][] = [
  ["0,0,0", "no gravity"],
  ["0,0,-9.81", "gravity −z"],
  ["0,0,9.81", "gravity +z"],
  ["0,-9.81,0", "gravity −y"],
  ["0,9.81,0", "gravity +y"],
  ["-9.81,0,0", "gravity −x"],
  ["9.81,0,0", "gravity +x"],
];

/** An organ under one law: on the stage and in the readings. */
class Specimen {
  readonly body: Body;
  readonly place = new THREE.Group();
  readonly root: HTMLElement;
  facts = { force: [0, 0, 0] as Vec3, residual: 1, taken: 1, isUnstable: false, milliseconds: 0, gain: 0 };
  field: Float32Array;
  private readonly force = element("output", { class: "force" }, "0.00");
  private readonly volume = element("output");
  private readonly residual = element("output");
  private readonly time = element("output");

  constructor(
    readonly surface: Surface,
    laws: readonly [string, string][],
    law: string,
    choose: (law: string) => void,
  ) {
    this.body = new Body(surface);
    this.place.add(this.body.mesh, this.body.outline);
    this.field = new Float32Array(surface.rest.length);
    const select = choice("law", laws, choose);
    select.value = law;
    const fact = (name: string, value: HTMLElement) => element("div", {}, element("dt", {}, name), element("dd", {}, value));
    this.root = element(
      "section",
      { class: "specimen", "aria-label": law },
      select,
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, fact("volume", this.volume), fact("residual", this.residual), fact("a frame", this.time)),
    );
  }

  /** Takes its part of a frame. */
  take(numbers: Float32Array): void {
    const [fx, fy, fz, residual, taken, unstable, milliseconds, gain] = numbers as unknown as number[];
    this.facts = {
      force: [fx!, fy!, fz!],
      residual: residual!,
      taken: taken!,
      isUnstable: unstable === 1,
      milliseconds: milliseconds!,
      gain: gain!,
    };
    this.field = numbers.slice(FACTS);
    this.body.move(this.field);
    this.force.textContent = newtons(Math.hypot(fx!, fy!, fz!)).slice(0, -2);
    this.volume.textContent = `${gain! > 0 ? "+" : ""}${fixed(100 * gain!, 2)} %`;
    this.volume.classList.toggle("is-wrong", Math.abs(gain!) > 0.01);
    this.residual.textContent = residual! > 0 ? residual!.toExponential(0).replace("-", "−") : "0";
    this.time.textContent = `${digits(milliseconds!, 2)} ms`;
  }
}

export class LiveView implements Touched {
  tool: Tool = "drag";
  readonly depth: number;
  readonly title: string;
  /** Frames received, for programs. */
  frames = 0;
  private wanted: Request = {};
  private isWaiting = false;
  private held: { point: Vec3; normal: Vec3; displacement: Vec3 } | null = null;
  private isColoured = false;
  private laws: string[];
  private specimens: Specimen[] = [];
  private readonly surface: Surface;
  private readonly stage: Stage;
  private readonly arrow: Arrow;
  private readonly root: HTMLElement;
  private readonly readings = element("section", { class: "panel readings live", "aria-label": "readings" });
  private readonly warning = element("div", { class: "warning", role: "alert" });
  private readonly legend = new Legend();

  constructor(
    place: HTMLElement,
    private readonly socket: WebSocket,
    private readonly hello: Hello,
  ) {
    this.surface = {
      rest: Float32Array.from(hello.rest),
      triangles: Uint32Array.from(hello.triangles),
      touchable: Uint32Array.from(hello.triangles),
      diagonal: hello.diagonal,
    };
    this.depth = 0.1 * hello.diagonal;
    this.laws = [hello.law];
    this.title = hello.name;
    const canvas = element("canvas", { class: "stage", tabindex: "0", "aria-label": `${hello.name}: press on it to grasp it` });
    this.root = element("div", { class: "view" }, canvas, this.header(), this.readings, this.legend.root, this.warning, this.tools());
    const host = element("div", { style: "position:absolute;inset:0" });
    host.attachShadow({ mode: "open" }).append(element("style", {}, style), this.root);
    place.append(host);
    this.stage = new Stage(canvas, lookOver(this.surface).centre, hello.diagonal, [0.2, -1, 0]);
    this.arrow = new Arrow(hello.diagonal, 0.5 * hello.radius);
    this.arrange();
    new Pointer(this.stage, { hit: (ray) => this.hit(ray) }, this);
    this.stage.onFrame = () => this.ask();
    socket.addEventListener("message", (event) => this.receive(event.data as string | ArrayBuffer));
    socket.addEventListener("close", () => this.say("The stepper has stopped: start viscera view again."));
  }

  // What a hand does.

  grab(hit: Hit): void {
    const normal = this.specimens[0]!.body.normalAt(hit.rest, this.hello.radius);
    const displacement = this.displacementAt(hit.rest);
    this.held = { point: hit.rest, normal, displacement };
    this.wanted = { ...this.wanted, grab: hit.rest, move: displacement, release: undefined };
  }

  move(displacement: Vec3): void {
    if (!this.held) return;
    this.held.displacement = displacement;
    this.wanted.move = displacement;
  }

  release(): void {
    this.held = null;
    this.arrow.hide();
    this.wanted = { ...this.wanted, grab: undefined, move: undefined, release: true };
  }

  hover(hit: Hit | null): void {
    if (this.held) return;
    if (hit) this.arrow.hover(hit.moved.sub(this.specimens[0]!.place.position).toArray(), this.specimens[0]!.body.normalAt(hit.rest, this.hello.radius));
    else this.arrow.hide();
    this.stage.invalidate();
  }

  contact(): { normal: Vec3; displacement: Vec3 } | null {
    return this.held;
  }

  // What tools and programs do.

  /** One law, or two side by side. */
  setLaws(laws: string[]): void {
    this.laws = laws;
    this.wanted.laws = laws;
    this.held = null;
    this.arrange();
  }

  setGravity(gravity: Vec3): void {
    this.wanted.gravity = gravity;
  }

  /** Takes hold of the surface near a point and displaces it [m]. */
  touch(point: Vec3, displacement: Vec3): void {
    this.grab({ rest: point, moved: new THREE.Vector3(...point) });
    this.move(displacement);
  }

  /** The state in numbers, for programs: SI units. */
  state(): Record<string, unknown> {
    return {
      frames: this.frames,
      laws: this.laws,
      held: this.held,
      specimens: this.specimens.map(({ facts, field }) => ({ ...facts, field: Array.from(field) })),
    };
  }

  /** Where a surface point at rest [m] is on the canvas, in CSS pixels. */
  project(point: Vec3): { x: number; y: number } {
    return this.stage.project(new THREE.Vector3(...point).add(this.specimens[0]!.place.position));
  }

  // How it goes on.

  private ask(): void {
    const isMoving = this.held !== null || this.specimens.some(({ facts }) => facts.residual > SETTLED);
    if (this.isWaiting || this.socket.readyState !== WebSocket.OPEN) return;
    if (!isMoving && Object.keys(this.wanted).length === 0) return;
    this.socket.send(JSON.stringify(this.wanted));
    this.wanted = {};
    this.isWaiting = true;
  }

  private receive(data: string | ArrayBuffer): void {
    this.isWaiting = false;
    if (typeof data === "string") return this.say((JSON.parse(data) as { error: string }).error);
    const numbers = new Float32Array(data);
    const size = FACTS + this.surface.rest.length;
    // A frame that was under way when the laws changed is of another number of organs.
    if (numbers[0] !== this.specimens.length) return;
    this.frames += 1;
    this.specimens.forEach((specimen, k) => specimen.take(numbers.subarray(1 + k * size, 1 + (k + 1) * size)));
    const cut = this.specimens.some(({ facts }) => facts.taken < 1);
    const unstable = this.specimens.some(({ facts }) => facts.isUnstable);
    this.say(cut ? "The hand is faster than the organ: a cell would turn inside out, the step is cut." : unstable ? "The organ is about to buckle here." : "");
    this.show();
  }

  private show(): void {
    const first = this.specimens[0]!;
    if (this.held) {
      const at = this.held.point.map((x, i) => x + this.held!.displacement[i]!) as Vec3;
      const size = Math.hypot(...first.facts.force);
      this.arrow.show(at, first.facts.force, this.held.normal, Math.max(size, 1e-9), !first.facts.isUnstable);
    }
    for (const { body, field } of this.specimens) {
      if (!this.isColoured) continue;
      const lengths = Float32Array.from({ length: field.length / 3 }, (_, n) => Math.hypot(...field.subarray(3 * n, 3 * n + 3)));
      body.paint(lengths, 0, this.depth, VIRIDIS);
    }
    this.stage.invalidate();
  }

  private say(sentence: string): void {
    this.warning.classList.toggle("is-shown", sentence !== "");
    if (sentence) this.warning.textContent = sentence;
  }

  /** Makes the organs anew, one for each law, side by side. */
  private arrange(): void {
    for (const { place, body } of this.specimens) {
      this.stage.world.remove(place);
      body.dispose();
    }
    const names = this.hello.laws.map((law) => [law, spaced(law)] as [string, string]);
    const right = this.stage.right;
    const along = Array.from({ length: this.surface.rest.length / 3 }, (_, n) =>
      right.reduce((sum, r, i) => sum + r * this.surface.rest[3 * n + i]!, 0),
    );
    const width = 1.15 * (Math.max(...along) - Math.min(...along));
    this.stage.widen(this.laws.length > 1 ? 1.6 : 1);
    this.specimens = this.laws.map((law, k) => {
      const specimen = new Specimen(this.surface, names, law, (chosen) => this.setLaws(this.laws.map((old, j) => (j === k ? chosen : old))));
      specimen.place.position.set(...right).multiplyScalar((k - 0.5 * (this.laws.length - 1)) * width);
      this.stage.world.add(specimen.place);
      return specimen;
    });
    this.specimens[0]!.place.add(this.arrow.group);
    this.arrow.hide();
    const isPair = this.laws.length > 1;
    const other = this.hello.laws.find((law) => law !== this.laws[0]) ?? this.laws[0]!;
    const toggle = button(isPair ? "One organ" : "Compare two laws", "one organ, or two laws in the same hand", () =>
      this.setLaws(isPair ? [this.laws[0]!] : [this.laws[0]!, this.laws[0] === "Linear" ? other : "Linear"]),
    );
    this.readings.replaceChildren(...this.specimens.map(({ root }) => root), toggle);
    this.stage.invalidate();
  }

  /** What a ray meets first of all organs. */
  private hit(ray: THREE.Raycaster): Hit | null {
    for (const { body, place } of this.specimens) {
      const hit = body.hit(ray);
      if (hit) return { rest: hit.rest, moved: hit.moved.add(place.position) };
    }
    return null;
  }

  /** Displacement of the node closest to a point: where a hand takes hold of a deformed organ. */
  private displacementAt(point: Vec3): Vec3 {
    const { rest } = this.surface;
    let [best, least] = [0, Infinity];
    for (let n = 0; n < rest.length; n += 3) {
      const distance = Math.hypot(rest[n]! - point[0], rest[n + 1]! - point[1], rest[n + 2]! - point[2]);
      if (distance < least) [best, least] = [n, distance];
    }
    return [...this.specimens[0]!.field.subarray(best, best + 3)] as Vec3;
  }

  private header(): HTMLElement {
    const facts = `${this.hello.rest.length / 3} surface nodes · one Newton iteration a frame, on this machine`;
    const theme = button("◐", "light or dark", () => {
      const dark = this.root.dataset.theme ? this.root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
      this.root.dataset.theme = dark ? "light" : "dark";
    });
    return element("header", {}, element("h1", {}, this.hello.name), element("p", {}, facts), element("div", { class: "corner" }, theme));
  }

  private tools(): HTMLElement {
    const tool = new Segments<Tool>(
      "tool",
      [
        ["push", "Push", "press on the organ, move down to push in and up to pull out"],
        ["drag", "Drag", "press on the organ and drag it in the plane of the screen"],
      ],
      (chosen) => (this.tool = tool.value = chosen),
    );
    tool.value = this.tool;
    const colour = button("Displacement", "colour by displacement", () => {
      this.isColoured = !this.isColoured;
      colour.setAttribute("aria-pressed", String(this.isColoured));
      if (this.isColoured) this.legend.show("displacement", VIRIDIS, this.depth);
      else {
        this.legend.hide();
        this.specimens.forEach(({ body }) => body.paintTissue());
      }
      this.show();
    });
    const outline = button("Wireframe", "the shape at rest as a wireframe", () => {
      const isOn = outline.getAttribute("aria-pressed") !== "true";
      outline.setAttribute("aria-pressed", String(isOn));
      this.specimens.forEach(({ body }) => (body.outline.visible = isOn));
      this.stage.invalidate();
    });
    const gravity = choice("gravity", GRAVITIES, (value) => this.setGravity(value.split(",").map(Number) as Vec3));
    gravity.value = GRAVITIES.find(([value]) => value === this.hello.gravity.map(String).join())?.[0] ?? "0,0,0";
    return element("nav", { class: "panel tools", "aria-label": "tools" }, tool.root, gravity, colour, outline, button("Reset", "begin anew", () => this.setLaws(this.laws)));
  }
}

/** Connects to the stepper and fills the place with its view. */
export function connect(place: HTMLElement, url: string): Promise<LiveView> {
  const address = new URL(url, location.href);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  return new Promise((resolve, reject) => {
    socket.addEventListener("message", (event) => resolve(new LiveView(place, socket, JSON.parse(event.data as string) as Hello)), { once: true });
    socket.addEventListener("close", () => reject(new Error("the stepper does not answer")), { once: true });
  });
}

/** "SaintVenantKirchhoff" as it is written. */
function spaced(law: string): string {
  const names: Record<string, string> = { NeoHookean: "neo-Hookean", MooneyRivlin: "Mooney-Rivlin", SaintVenantKirchhoff: "Saint Venant-Kirchhoff" };
  return names[law] ?? law;
}
