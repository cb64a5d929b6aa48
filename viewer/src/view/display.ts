// How a touch is shown: shape and colour of the organ, the arrow with its number, what lies within, readings and words.
import { Arrow } from "../stage/arrow";
import { Body } from "../stage/body";
import { Painter, type Coloured } from "./colouring";
import { element, newtons, write } from "../base/dom";
import type { Evaluator, Vec3 } from "../model/evaluator";
import { Gauge } from "../panels/gauge";
import { Inside, shiftInWords, type Shift } from "../stage/inside";
import { ForceLabel } from "../stage/label";
import { Legend } from "../panels/legend";
import { paceInWords } from "../base/pace";
import type { Reading } from "../hands/pointer";
import { Readings } from "../panels/readings";
import { Speech } from "../panels/speech";
import type { Stage } from "../stage/stage";
import type { TouchState } from "../touch/touchstate";
import { typicalForce } from "../stage/typicalforce";

export class Display {
  readonly body: Body;
  readonly arrow: Arrow;
  readonly inside: Inside;
  readonly label: ForceLabel;
  readonly gauge: Gauge;
  readonly legend = new Legend();
  readonly painter: Painter;
  readonly readings: Readings;
  readonly speech: Speech;
  readonly clock = element("div", { class: "clock" });
  /** The longest arrow's force [N]. */
  readonly reference: number;

  constructor(
    private readonly evaluator: Evaluator,
    private readonly stage: Stage,
    chooseOrder: (order: number) => void,
  ) {
    const { metadata } = evaluator.about;
    this.speech = new Speech(stage);
    this.body = new Body(evaluator);
    this.painter = new Painter(evaluator, this.body, this.legend, metadata);
    this.arrow = new Arrow(metadata.diagonal, 0.5 * metadata.radius, metadata.radius);
    this.inside = new Inside(evaluator.rest, evaluator.notes.inside ?? []);
    this.readings = new Readings(metadata.order, chooseOrder);
    this.gauge = new Gauge(stage, evaluator.notes.axes);
    this.label = new ForceLabel(stage, this.arrow, this.gauge.root);
    stage.world.add(this.body.mesh, this.body.outline, this.arrow.group, this.inside.group);
    this.reference = typicalForce(evaluator, this.body);
  }

  /** Shows a touch in the field of an order, and says it aloud unless it goes on by itself; null is nobody touching. */
  show(touching: TouchState | null, order: number, isSaid: boolean): void {
    if (touching) {
      const at = touching.point.map((x, i) => x + touching.displacement[i]!) as Vec3;
      const center = touching.felt?.center ?? null;
      this.arrow.show(at, touching.force, touching.normal, this.reference, touching.standing(order), center);
      touching.orders.forEach((reading, k) => this.readings.showOrder(k + 1, reading));
    }
    const reading = touching && touching.reading(order);
    this.readings.show(reading);
    this.readings.draw(touching?.curves ?? null, order, this.evaluator.about.metadata.depth, reading);
    this.showField(touching, order, this.shifts(touching, order), touching?.worth(order) === "");
    this.speech.say(touching && isSaid ? this.caption(touching, order) : "", touching?.warning(order) ?? "");
  }

  /** Shows the field of an order and what lies within; null is nobody touching. */
  showField(shown: Coloured | null, order: number, shifts: Shift[] | null, isTrusted: boolean): void {
    if (shown) {
      this.body.move(shown.field);
      this.inside.move(shown.field);
    }
    this.inside.show(shifts, isTrusted);
    this.painter.show(shown, order);
  }

  /** Leaves the place of the readings and of the arrow to two hands, or takes it back. */
  set isPassive(isPassive: boolean) {
    this.readings.root.hidden = isPassive;
    if (isPassive) this.arrow.hide();
  }

  /** Leaves the whole stage to a stepped organ, or takes it back. */
  set isAway(isAway: boolean) {
    this.isPassive = isAway;
    this.body.mesh.visible = this.inside.group.visible = !isAway;
    this.inside.root.hidden = isAway || this.inside.isEmpty;
    if (isAway) this.legend.hide();
  }

  /** Marks where a press would touch; null is nowhere. */
  hover(point: Vec3 | null): void {
    if (point) this.arrow.hover(point, this.body.normalAt(point, this.evaluator.about.metadata.radius));
    else this.arrow.hide();
    this.stage.invalidate();
  }

  /** The shape at rest, with nobody touching. */
  rest(): void {
    this.body.move(null);
    this.inside.move(null);
    this.arrow.hide();
    for (let p = 1; p <= this.evaluator.about.metadata.order; p++) this.readings.showOrder(p, null);
  }

  /** Keeps up with the camera, every frame; the mean time of an answer in milliseconds. */
  follow(touching: TouchState | null, order: number, answer: number): void {
    this.gauge.follow();
    this.label.follow(Math.hypot(...(touching?.force ?? [])), touching?.standing(order) ?? "sound");
    const { pace, drawing } = this.stage;
    const times: [string, number][] = [
      ["answer", answer],
      ["drawing", drawing.value],
    ];
    write(this.clock, paceInWords(pace.rate, times));
  }

  /** How far the parts within have moved; null where nobody touches. */
  shifts(touching: TouchState | null, order: number): Shift[] | null {
    return touching && this.inside.shifts(touching.field, touching.fieldError(order), touching.typical);
  }

  /** What is told beside the force. */
  reading(touching: TouchState, order: number): Reading {
    const standing = touching.standing(order);
    const worth = standing === "sound" ? "trusted" : "not trusted";
    return { force: newtons(Math.hypot(...touching.force)), worth, standing, at: this.arrow.endsInScene()[1] };
  }

  /** The touch as one would say it, and what it is worth if that is to be said, too. */
  caption(touching: TouchState, order: number, worth = ""): string {
    const shifts = this.shifts(touching, order)!.map((shift) => `${shift.name} moved ${shiftInWords(shift)}.`);
    return [touching.inShort(order, worth), ...shifts].join(" ");
  }

  dispose(): void {
    this.speech.dispose();
    this.readings.dispose();
    this.arrow.dispose();
    this.body.dispose();
    this.inside.dispose();
  }
}
