// How the organ is looked at: whole, translucent, or cut open by a plane that faces the viewer.
import * as THREE from "three";
import type { Body } from "./body";
import { element, millimetres, Segments } from "../base/dom";
import type { Stage } from "./stage";

export type Looking = "solid" | "translucent" | "cut";
export const LOOKINGS: readonly Looking[] = ["solid", "translucent", "cut"];

export class Sight {
  /** What chooses, and what moves the plane through the organ. */
  readonly choice: Segments<Looking>;
  readonly slider = element("input", { type: "range", min: "-0.5", max: "0.5", step: "0.005", "aria-label": "depth of the cut" });
  looking: Looking = "solid";
  /** Of the cut, in metres: what lies on its positive side is left. */
  private readonly plane = new THREE.Plane();
  /** The same in the scene, where things are drawn. */
  private readonly drawn = new THREE.Plane();

  constructor(
    private readonly stage: Stage,
    private readonly bodies: () => readonly Body[],
    private readonly changed: () => void = () => {},
  ) {
    stage.renderer.localClippingEnabled = true;
    this.choice = new Segments<Looking>(
      "look",
      [
        ["solid", "Solid", "the organ from outside"],
        ["translucent", "Translucent", "see the parts within"],
        ["cut", "Cut", "cut the organ open by a plane that faces you"],
      ],
      (looking) => this.choose(looking),
    );
    this.slider.addEventListener("input", () => this.cutAt(Number(this.slider.value)));
    this.choose("solid");
  }

  choose(looking: Looking): void {
    this.looking = looking;
    this.choice.value = looking;
    this.slider.hidden = looking !== "cut";
    if (looking === "cut") {
      // Away from the viewer, through the middle; as seen now, so that turning the view shows the cut from the side.
      const { world, camera, centre } = this.stage;
      this.stage.place();
      const away = camera.getWorldDirection(new THREE.Vector3()).transformDirection(world.matrixWorld.clone().invert());
      this.plane.setFromNormalAndCoplanarPoint(away, new THREE.Vector3(...centre));
      this.sayPlace(0);
    }
    this.renew();
    this.changed();
  }

  next(): void {
    this.choose(LOOKINGS[(LOOKINGS.indexOf(this.looking) + 1) % LOOKINGS.length]!);
  }

  /** Moves the cut to a place along its normal [diagonals], 0 being the organ's middle. */
  cutAt(place: number): void {
    const { centre, diagonal } = this.stage;
    this.sayPlace(place);
    const through = new THREE.Vector3(...centre).addScaledVector(this.plane.normal, place * diagonal);
    this.plane.setFromNormalAndCoplanarPoint(this.plane.normal.clone(), through);
    this.renew();
  }

  /** Puts the slider at a place of the cut [diagonals], and says it in millimetres to those who listen. */
  private sayPlace(place: number): void {
    this.slider.value = String(place);
    const off = Number(this.slider.value);
    const side = off < 0 ? "before" : "behind";
    const words = off === 0 ? "through the middle" : `${millimetres(Math.abs(off) * this.stage.diagonal)} ${side} the middle`;
    this.slider.setAttribute("aria-valuetext", words);
  }

  /** Gives bodies that are new the present look. */
  renew(): void {
    const cut = this.looking === "cut" ? this.plane : null;
    this.bodies().forEach((body) => body.look(this.looking === "translucent", cut, this.drawn));
    this.follow();
    this.stage.invalidate();
  }

  /** Takes the plane to where the organ is in the scene: a headset moves it. */
  follow(): void {
    if (this.looking === "cut") this.drawn.copy(this.plane).applyMatrix4(this.stage.world.matrixWorld);
  }
}
