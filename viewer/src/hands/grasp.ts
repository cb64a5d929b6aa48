// What squeezing hands do in a headset: one moves and turns the organ with it, two scale it as well.
import * as THREE from "three";

/** The organ's diagonal in the room is within these [m]. */
const SMALLEST = 0.1;
const LARGEST = 3;

export class Grasp {
  /** The hands that squeeze, each with its place when the grasp began. */
  private squeezing: Squeeze[] = [];
  private readonly before = new THREE.Matrix4();
  private readonly deaf: (() => void)[];

  constructor(
    private readonly room: THREE.Object3D,
    poses: readonly THREE.Object3D[],
  ) {
    this.deaf = poses.map((pose) => {
      const target = pose as THREE.EventDispatcher<Record<string, object>>;
      const [press, loosen] = [() => this.begin([...this.poses, pose]), () => this.begin(this.poses.filter((other) => other !== pose))];
      target.addEventListener("squeezestart", press);
      target.addEventListener("squeezeend", loosen);
      return () => {
        target.removeEventListener("squeezestart", press);
        target.removeEventListener("squeezeend", loosen);
      };
    });
  }

  /** Takes the room along with the hands that squeeze. */
  follow(): void {
    const [one, other] = this.squeezing;
    if (!one) return;
    const moved = other ? this.between(one, other) : one.pose.matrixWorld.clone().multiply(one.from.clone().invert());
    moved.multiply(this.before).decompose(this.room.position, this.room.quaternion, this.room.scale);
  }

  dispose(): void {
    this.deaf.forEach((end) => end());
  }

  private get poses(): THREE.Object3D[] {
    return this.squeezing.map(({ pose }) => pose);
  }

  /** Starts from how the room and the hands are now. */
  private begin(poses: readonly THREE.Object3D[]): void {
    this.squeezing = poses.map((pose) => ({ pose, from: pose.matrixWorld.clone() }));
    this.room.updateMatrix();
    this.before.copy(this.room.matrix);
  }

  /** The least turn, with the scale and the shift, that takes two hands from where they were to where they are. */
  private between(...hands: [Squeeze, Squeeze]): THREE.Matrix4 {
    const [was, is] = [hands.map(({ from }) => from), hands.map(({ pose }) => pose.matrixWorld)].map((matrices) => {
      const [a, b] = matrices.map((matrix) => new THREE.Vector3().setFromMatrixPosition(matrix)) as [THREE.Vector3, THREE.Vector3];
      return { middle: a.clone().add(b).multiplyScalar(0.5), apart: b.sub(a) };
    }) as [Pair, Pair];
    const size = new THREE.Vector3().setFromMatrixScale(this.before).x;
    const ratio = is.apart.length() / Math.max(was.apart.length(), 1e-3);
    const scale = Math.min(Math.max(ratio, SMALLEST / size), LARGEST / size);
    const turn = new THREE.Quaternion().setFromUnitVectors(was.apart.normalize(), is.apart.normalize());
    return new THREE.Matrix4()
      .compose(is.middle, turn, new THREE.Vector3().setScalar(scale))
      .multiply(new THREE.Matrix4().makeTranslation(was.middle.negate()));
  }
}

type Squeeze = { pose: THREE.Object3D; from: THREE.Matrix4 };
type Pair = { middle: THREE.Vector3; apart: THREE.Vector3 };
