// Whether an answer may be relied on, in words; empty where it may.
import { percent } from "./dom";
import type { Answer, Description, Felt } from "./evaluator";

/** From here on a lower order's field is too far from the highest one's, relative to that. */
const FAR = 0.05;

type Model = Description["metadata"];

/** What is wrong with the answer of the highest order to a contact that is so deep [m], or with what a probe feels. */
export function doubtOf(answer: Answer, felt: Felt | null, depth: number, model: Model): string {
  if (felt?.grip === "inside") return "the probe is inside the organ; let go and touch again";
  switch (answer.trust) {
    case "beyond-depth":
      if (felt) return `the probe has entered by ${mm(-felt.gap)}, beyond the ${mm(Math.min(model.depth, model.radius))} that it may`;
      return `a depth of ${mm(depth)} exceeds the ${mm(model.depth)} that this model is made for`;
    case "error-too-large":
      return `the estimated error is ${percent(answer.error)} here`;
    case "no-number":
      return "the answer is not a finite number here";
  }
  return "";
}

/** Whether an order's field is so far `off` that of the highest one. */
export function doubtOfOrder(order: number, highest: number, off: number): string {
  if (order === highest || off <= FAR) return "";
  const name = order === 1 ? "linear theory" : `order ${order}`;
  return `${name} is ${percent(off)} away from order ${highest} here`;
}

function mm(length: number): string {
  return `${(1000 * length).toFixed(1)} mm`;
}
