// What the organ shows by itself: a contact that sticks and moves over it, and the modes of its field.
import type { Evaluator, Vec3 } from "../model/evaluator";
import { Modes } from "../panels/modes";
import type { Stage } from "../stage/stage";
import { Walk } from "../stage/walk";
import { TouchState } from "../touch/touchstate";
import type { Display } from "./display";

export class Demonstration {
  private readonly modes: Modes;
  private readonly walk: Walk;

  constructor(
    private readonly evaluator: Evaluator,
    private readonly stage: Stage,
    private readonly display: Display,
    /** Shows whether it goes on. */
    private readonly press: (button: "path" | "modes", isOn: boolean) => void,
  ) {
    this.modes = new Modes(evaluator, display.body, stage.towards, () => stage.invalidate());
    this.walk = new Walk(evaluator, display.body, stage.world);
  }

  /** Where a mode is chosen. */
  get root(): HTMLElement {
    return this.modes.root;
  }

  /** How many shapes the path of the contact has shown. */
  get shapes(): number {
    return this.walk.shapes;
  }

  /** Whether there is a path over the organ. */
  beginPath(): boolean {
    if (!this.walk.begin()) return false;
    this.press("path", true);
    return true;
  }

  /** The next touch of the path, and the displacement that it asks for [m]. */
  walkOn(seconds: number, order: number): { touching: TouchState; displacement: Vec3 } {
    const { point, normal, displacement } = this.walk.advance(seconds, order);
    return { touching: new TouchState(this.evaluator, point, normal), displacement };
  }

  /** Modes have no force and no error: what tells them is hidden. */
  beginModes(): void {
    const { legend, readings, inside } = this.display;
    this.press("modes", true);
    legend.hide();
    readings.root.hidden = inside.root.hidden = true;
    this.modes.show();
  }

  stepMode(by: number): void {
    this.modes.step(by);
  }

  swing(seconds: number): void {
    this.display.inside.move(this.modes.advance(seconds));
    this.stage.invalidate();
  }

  /** Ends both. */
  end(): void {
    const { readings, inside } = this.display;
    this.modes.hide();
    this.walk.end();
    readings.root.hidden = false;
    inside.root.hidden = inside.isEmpty;
    this.press("modes", false);
    this.press("path", false);
  }

  dispose(): void {
    this.walk.dispose();
  }
}
