// A controller of a headset: its trigger takes hold of what its beam meets, a sign tells the force, a pulse is felt.
import * as THREE from "three";
import type { Standing } from "../stage/arrow";
import type { Body } from "../stage/body";
import type { Touched } from "./pointer";
import { Sign } from "./sign";
import type { Stage } from "../stage/stage";

/** How strong and how long a pulse is [ms]: of taking hold, and of a force that is not to be relied on any more. */
const HOLD = [0.5, 30] as const;
const DOUBT = [1, 120] as const;

/** A hand that moves by less of the depth has not moved. */
const SAME = 1e-6;

/** Which controller each hand of a view belongs to at present. */
const owners = new WeakMap<Touched, (Controller | undefined)[]>();

export class Controller {
  /** Where it is in the room; its beam leaves along -z. */
  readonly pose: THREE.Group;
  private readonly beam = new THREE.Line(
    new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3(0, 0, -1)]),
    new THREE.LineBasicMaterial({ color: 0x8fb8ff }),
  );
  private readonly sign = new Sign();
  private readonly ray = new THREE.Raycaster();
  /** The hand that it is; where one alone can touch, either controller is that one. */
  private hand: number;
  /** From where the contact's displacement counts [m]; null while it holds nothing. */
  private start: THREE.Vector3 | null = null;
  private readonly displacement = new THREE.Vector3();
  private standing: Standing = "sound";
  private source: XRInputSource | null = null;
  private readonly listening = [
    ["connected", ({ data }: { data: XRInputSource }) => (this.source = data)],
    ["selectstart", () => this.grab()],
    ["move", () => this.move()],
    ["selectend", () => this.release()],
  ] as const;

  constructor(
    private readonly index: number,
    private readonly stage: Stage,
    private readonly body: Pick<Body, "hit">,
    private readonly touched: Touched,
  ) {
    this.pose = stage.renderer.xr.getController(index);
    this.hand = index;
    this.pose.add(this.beam);
    stage.scene.add(this.pose, this.sign.sprite);
    const pose = this.pose as THREE.EventDispatcher<Record<string, object>>;
    for (const [name, listen] of this.listening) pose.addEventListener(name, listen as (event: object) => void);
  }

  /** Keeps the sign beside the force, and tells the hand when it is not to be relied on any more. */
  follow(): void {
    const reading = this.start && this.touched.reading(this.hand);
    this.sign.show(reading);
    const standing = reading?.standing ?? "sound";
    if (standing === "doubtful" && this.standing !== standing) this.pulse(...DOUBT);
    this.standing = standing;
  }

  dispose(): void {
    this.release();
    const pose = this.pose as THREE.EventDispatcher<Record<string, object>>;
    for (const [name, listen] of this.listening) pose.removeEventListener(name, listen as (event: object) => void);
    this.pose.remove(this.beam);
    this.stage.scene.remove(this.pose, this.sign.sprite);
    this.beam.geometry.dispose();
    this.beam.material.dispose();
    this.sign.dispose();
  }

  private get owners(): (Controller | undefined)[] {
    if (!owners.has(this.touched)) owners.set(this.touched, []);
    return owners.get(this.touched)!;
  }

  private grab(): void {
    const free = [this.index, 0, 1].find((hand) => hand < this.touched.hands && !this.owners[hand]);
    if (free === undefined) return;
    this.hand = free;
    const along = new THREE.Vector3(0, 0, -1).applyQuaternion(this.pose.getWorldQuaternion(new THREE.Quaternion()));
    this.ray.set(this.pose.getWorldPosition(new THREE.Vector3()), along);
    const hit = this.body.hit(this.ray);
    if (!hit) return;
    this.owners[this.hand] = this;
    this.touched.grab(hit, this.hand);
    const displacement = this.touched.contact(this.hand)?.displacement ?? [0, 0, 0];
    this.displacement.set(...displacement);
    this.start = this.place().sub(this.displacement);
    this.pulse(...HOLD);
  }

  private move(): void {
    if (!this.start) return;
    const displacement = this.place().sub(this.start);
    // It tells of itself in every frame, also when it has not moved.
    if (displacement.distanceTo(this.displacement) < SAME * this.touched.depth) return;
    this.displacement.copy(displacement);
    this.touched.move(displacement.toArray(), this.hand);
  }

  private release(): void {
    if (!this.start) return;
    this.start = null;
    this.owners[this.hand] = undefined;
    this.touched.release(this.hand);
  }

  /** Where it is in the organ's own coordinates [m]. */
  private place(): THREE.Vector3 {
    return this.stage.world.worldToLocal(this.pose.getWorldPosition(new THREE.Vector3()));
  }

  /** A pulse, where the controller has a motor. */
  private pulse(strength: number, milliseconds: number): void {
    void this.source?.gamepad?.hapticActuators?.[0]?.pulse(strength, milliseconds);
  }
}
