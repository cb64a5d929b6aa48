// At the first visit: where one may touch.
import type * as THREE from "three";
import { element } from "../base/dom";
import type { Hit } from "../stage/body";
import type { Stage } from "../stage/stage";

const KEY = "viscera.touched";

export class Hint {
  readonly root = element("div", { class: "hint", "aria-hidden": "true" }, "Press here and drag");

  private spot: THREE.Vector3 | null = null;

  /** A hint at a place of the organ, until somebody has touched it once in this browser. */
  constructor(
    private readonly stage: Stage,
    private readonly where: () => Hit | null,
  ) {
    this.root.hidden = hasTouched();
  }

  /** Stands where it belongs, while nobody touches. */
  follow(isAtRest: boolean): void {
    if (this.root.hidden) return;
    this.root.classList.toggle("is-waiting", !isAtRest);
    if (!isAtRest) return;
    this.spot ??= this.where()?.moved ?? null;
    if (!this.spot) return;
    const { x, y } = this.stage.project(this.spot);
    this.root.style.transform = `translate(${x}px, ${y}px)`;
  }

  /** Somebody has found out. */
  end(): void {
    if (this.root.hidden) return;
    this.root.hidden = true;
    try {
      localStorage.setItem(KEY, "yes");
    } catch {
      // A browser that keeps nothing shows the hint again.
    }
  }
}

function hasTouched(): boolean {
  try {
    return localStorage.getItem(KEY) === "yes";
  } catch {
    return false;
  }
}
