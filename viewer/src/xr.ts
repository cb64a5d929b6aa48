// A headset: the organ hangs in front of the viewer, and a controller's trigger takes hold of it.
import * as THREE from "three";
import type { Body } from "./body";
import { button } from "./dom";
import type { Touched } from "./pointer";
import type { Stage } from "./stage";

/** Metres that the organ's diagonal measures in the room, and where it hangs. */
const SIZE = 0.6;
const PLACE = new THREE.Vector3(0, 1.25, -0.65);

/** A button that enters the headset; stays hidden where there is none. */
export function headsetButton(stage: Stage, body: Pick<Body, "hit">, touched: Touched): HTMLButtonElement {
  const enter = button("VR", "touch the organ in a headset", () => void start(stage, body, touched, enter));
  enter.hidden = true;
  navigator.xr
    ?.isSessionSupported("immersive-vr")
    .then((isSupported) => (enter.hidden = !isSupported))
    .catch(() => {});
  return enter;
}

async function start(stage: Stage, body: Pick<Body, "hit">, touched: Touched, enter: HTMLButtonElement): Promise<void> {
  const { renderer, scene } = stage;
  const session = await navigator.xr?.requestSession("immersive-vr", { optionalFeatures: ["local-floor"] });
  if (!session) return;
  enter.disabled = true;
  const room = new THREE.Group();
  room.position.copy(PLACE);
  // Headsets hold y upright, organs z.
  room.rotation.x = -Math.PI / 2;
  room.scale.setScalar(SIZE);
  room.add(stage.world);
  scene.add(room);
  renderer.xr.enabled = true;
  await renderer.xr.setSession(session);
  const hands = [0, 1].map((index) => hand(index, stage, body, touched));
  session.addEventListener("end", () => {
    hands.forEach((leave) => leave());
    renderer.xr.enabled = false;
    scene.add(stage.world);
    scene.remove(room);
    enter.disabled = false;
    stage.goHome();
  });
}

/** A controller with a beam; returns what removes it. */
function hand(index: number, stage: Stage, body: Pick<Body, "hit">, touched: Touched): () => void {
  const controller = stage.renderer.xr.getController(index);
  const beam = new THREE.Line(
    new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3(0, 0, -1)]),
    new THREE.LineBasicMaterial({ color: 0x8fb8ff }),
  );
  controller.add(beam);
  stage.scene.add(controller);
  const ray = new THREE.Raycaster();
  // Where one hand alone can touch, either controller is that one.
  const own = Math.min(index, touched.hands - 1);
  const place = () => stage.world.worldToLocal(controller.getWorldPosition(new THREE.Vector3()));
  let start: THREE.Vector3 | null = null;
  const grab = () => {
    const from = controller.getWorldPosition(new THREE.Vector3());
    const along = new THREE.Vector3(0, 0, -1).applyQuaternion(controller.getWorldQuaternion(new THREE.Quaternion()));
    ray.set(from, along);
    const hit = touched.hands > 0 ? body.hit(ray) : null;
    if (!hit) return;
    touched.grab(hit, own);
    const displacement = touched.contact(own)?.displacement ?? [0, 0, 0];
    start = place().sub(new THREE.Vector3(...displacement));
  };
  const follow = () => start && touched.move(place().sub(start).toArray(), own);
  const release = () => {
    if (start) touched.release(own);
    start = null;
  };
  controller.addEventListener("selectstart", grab);
  controller.addEventListener("move", follow);
  controller.addEventListener("selectend", release);
  return () => {
    release();
    controller.removeEventListener("selectstart", grab);
    controller.removeEventListener("move", follow);
    controller.removeEventListener("selectend", release);
    controller.remove(beam);
    stage.scene.remove(controller);
    beam.geometry.dispose();
    beam.material.dispose();
  };
}
