// Whether an answer may be relied on, in words; empty where it may.
import { millimetres, percent } from "../base/dom";
import type { Answer, Beside, Description, Felt } from "../model/evaluator";

/** From here on a lower order's answer is too far from the highest one's, relative to that. */
const FAR = 0.05;

/** What a probe touches that the model does not answer for, in words. */
const BESIDE: Record<Exclude<Beside, "nothing">, string> = {
  support: "the probe touches where the organ is fixed",
  "second-place": "the probe touches the organ at a second place",
  untouchable: "the probe touches the organ beside its touchable surface",
};

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
      return felt ? doubtOfFelt(felt, model) : tooLarge("the estimated error", answer.error, allowance(depth / model.diagonal), model);
    case "no-number":
      return "the answer is not a finite number here";
  }
  return "";
}

/** What is wrong with what a probe feels, whose estimated error is too large (bindings/python/src/probe.rs). */
function doubtOfFelt({ beside, decisive }: Felt, model: Model): string {
  if (beside !== "nothing") return BESIDE[beside];
  const { estimate, allowed, ofContact } = decisive;
  if (ofContact === 0) return tooLarge("the model's estimated error", estimate, allowed, model);
  return `the estimated error, with ${percent(ofContact)} for the contact, is ${percent(estimate)}, above the ${percent(allowed)} that is allowed`;
}

/**
 * What the model's estimate is here, and what is allowed of it. Where the range of a parameter alone brings more, that is
 * the reason (bindings/python/src/model.rs).
 */
function tooLarge(error: string, estimate: number, allowed: number, { errors, user }: Model): string {
  const ofRange = errors.parameter ?? 0;
  const isAbove = `above the ${percent(allowed)} that is allowed here`;
  if (ofRange <= allowed) return `${error} is ${percent(estimate)}, ${isAbove}`;
  return `between the values of ${user?.parameter?.name ?? "the parameter"} that were solved, answers are up to ${percent(ofRange)} off, ${isAbove}; give Vary more nodes`;
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
