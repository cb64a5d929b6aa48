// Whether an answer may be relied on, in words; empty where it may.
import { millimetres, percent } from "../base/dom";
import type { Answer, Description, Felt } from "../model/evaluator";

/** From here on a lower order's answer is too far from the highest one's, relative to that. */
const FAR = 0.05;

type Model = Description["metadata"];

/** How far a lower order's answer is from the highest one's, relative to that: its field, and its force. */
export interface Distances {
  off: number;
  forceOff: number;
}

/**
 * What is wrong with the answer of the highest order to a contact that is so deep [m], or with what a probe feels. The
 * contact was to go deeper where it slipped.
 */
export function doubtOf(answer: Answer, felt: Felt | null, depth: number, model: Model, slipped = 0): string {
  if (felt?.grip === "inside") return "the probe is inside the organ; let go and touch again";
  switch (answer.trust) {
    case "beyond-depth":
      if (felt) return `the probe has entered by ${millimetres(-felt.gap)}, beyond the ${millimetres(Math.min(model.depth, model.radius))} that it may`;
      const beyond = `a depth of ${millimetres(depth)} exceeds the ${millimetres(model.depth)} that this model is made for`;
      return slipped > 0 ? `${beyond}, and the contact slips before the ${millimetres(slipped)} that were asked for` : beyond;
    case "error-too-large":
      return `the estimated error is ${percent(answer.error)} here`;
    case "no-number":
      return "the answer is not a finite number here";
  }
  return "";
}

/** What is wrong with a lower order's answer, whose force may be so far from the highest one's. */
export function doubtOfOrder(order: number, highest: number, { off, forceOff }: Distances, room: number): string {
  const name = order === 1 ? "linear theory" : `order ${order}`;
  if (forceOff > room) return `the force of ${name} is ${percent(forceOff)} away from that of order ${highest} here`;
  return off > FAR ? `${name} is ${percent(off)} away from order ${highest} here` : "";
}

/**
 * How far a lower order's answer may be from one of the highest order that is trusted with an estimated error: with the
 * distance the estimate stays within the allowance at such a depth. That of a probe contains the contact's error, which has
 * another measure (docs/probe.md).
 */
export function roomBeside(error: number, depth: number, { diagonal }: Model, hasProbe: boolean): number {
  return hasProbe ? FAR : Math.max(0, allowance(depth / diagonal) - error);
}

/** The error allowed at a depth, as part of the diagonal (crates/touch/src/evaluate.rs). */
function allowance(depth: number): number {
  return 0.01 + 0.04 * Math.min(Math.max((depth - 0.05) / 0.05, 0), 1);
}
