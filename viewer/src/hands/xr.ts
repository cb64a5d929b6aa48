// A headset: the organ hangs in front of the viewer; triggers take hold of it, squeezing hands turn and scale it.
import * as THREE from "three";
import type { Body } from "../stage/body";
import { Controller } from "./controller";
import { button } from "../base/dom";
import { Grasp } from "./grasp";
import type { Touched } from "./pointer";
import type { Stage } from "../stage/stage";

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
  touched.expectTwo?.();
  // Before the session, which tells each controller at once what it is.
  const controllers = [0, 1].map((index) => new Controller(index, stage, body, touched));
  const grasp = new Grasp(room, controllers.map(({ pose }) => pose));
  await renderer.xr.setSession(session);
  stage.onHeadset = () => {
    grasp.follow();
    controllers.forEach((controller) => controller.follow());
  };
  session.addEventListener("end", () => {
    stage.onHeadset = () => {};
    controllers.forEach((controller) => controller.dispose());
    grasp.dispose();
    renderer.xr.enabled = false;
    scene.add(stage.world);
    scene.remove(room);
    enter.disabled = false;
    stage.goHome();
  });
}
