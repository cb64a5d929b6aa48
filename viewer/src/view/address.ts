// A touch in an address: #touch=x,y,z;dx,dy,dz&order=4&stiffness=2&colour=displacement&look=cut&from=x,y,z, lengths in
// millimetres.
import { COLOURINGS, type Colouring } from "./colouring";
import { decimalsOf } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { LOOKINGS, type Looking } from "../stage/sight";
import type { View } from "./view";

const ELSEWHERE = "This link touches a place that is not on the touchable surface. The organ is shown at rest.";

/** No address multiplies stiffnesses by more, or divides them by more. */
const STIFFEST = 1000;

/** What an address carries; what it leaves out stays as it is. */
interface Carried {
  point?: Vec3;
  displacement?: Vec3;
  order?: number;
  /** All stiffnesses of the organ, in units of its own. */
  stiffness?: number;
  colour?: string;
  look?: string;
  /** Where the camera stands [diagonals]. */
  from?: Vec3;
}

/** What follows the # of an address that shows the touch of a view, seen as it is. */
export function addressOf({ touching, order, evaluator, display, sight, stage, depth }: View): string {
  const carried: Carried = {
    ...(touching && { point: touching.point, displacement: touching.displacement }),
    order,
    ...(evaluator.notes.is_stress_free && { stiffness: evaluator.factor }),
    colour: display.painter.colouring,
    look: sight.looking,
    from: stage.camera.position.toArray(),
  };
  return written(carried, depth);
}

/** Lets a view do what the page's address says, now and whenever it is another one; returns what ends that. */
export function followAddress(view: View): () => void {
  const listener = () => follow(view, read(location.hash));
  listener();
  window.addEventListener("hashchange", listener);
  return () => window.removeEventListener("hashchange", listener);
}

function follow(view: View, { point, displacement, order, stiffness, colour, look, from }: Carried): void {
  if (order) view.setOrder(order);
  if (stiffness) view.setStiffness(stiffness);
  if (COLOURINGS.includes(colour as Colouring)) view.setColouring(colour as Colouring);
  if (from) view.stage.lookFrom(from);
  if (LOOKINGS.includes(look as Looking)) view.sight.choose(look as Looking);
  if (!point || !displacement) return;
  if (view.evaluator.touch(point)) return view.touch(point, displacement);
  view.rest();
  view.display.speech.say("", ELSEWHERE);
}

/** What follows the #; a place is as exact as the depth [m] that the model is made for asks. */
function written({ point, displacement, order, stiffness, colour, look, from }: Carried, depth: number): string {
  const said = new URLSearchParams();
  if (point && displacement) {
    const size = Math.hypot(...displacement);
    said.set("touch", `${inMillimetres(point, depth)};${inMillimetres(displacement, size)}`);
  }
  if (order) said.set("order", String(order));
  if (stiffness) said.set("stiffness", String(Number(stiffness.toPrecision(6))));
  if (colour) said.set("colour", colour);
  if (look) said.set("look", look);
  if (from) said.set("from", listed(from, 1, 4));
  return decodeURIComponent(said.toString());
}

/** What an address says after its #; what makes no sense is left out. */
function read(hash: string): Carried {
  const said = new URLSearchParams(hash.replace(/^#/, ""));
  const carried: Carried = {};
  const [point, displacement] = (said.get("touch") ?? "").split(";").map((text) => numbers(text, 1000));
  if (point && displacement) Object.assign(carried, { point, displacement });
  const order = Number(said.get("order"));
  if (Number.isInteger(order) && order > 0) carried.order = order;
  const stiffness = Number(said.get("stiffness"));
  if (stiffness >= 1 / STIFFEST && stiffness <= STIFFEST) carried.stiffness = stiffness;
  for (const name of ["colour", "look"] as const) if (said.get(name)) carried[name] = said.get(name)!;
  const from = numbers(said.get("from") ?? "", 1);
  if (from && Math.hypot(...from) > 0.1) carried.from = from;
  return carried;
}

/** A vector with five digits of a length [m]: an organ may be as small as it likes. */
function inMillimetres(vector: Vec3, length: number): string {
  return listed(vector, 1000, length > 0 ? Math.min(Math.max(decimalsOf(1000 * length, 5), 0), 20) : 0);
}

function listed(vector: Vec3, unit: number, decimals: number): string {
  return vector.map((x) => String(Number((unit * x).toFixed(decimals)))).join(",");
}

function numbers(text: string, unit: number): Vec3 | null {
  const found = text.split(",").map((part) => (part.trim() ? Number(part) / unit : NaN));
  return found.length === 3 && found.every(Number.isFinite) ? (found as Vec3) : null;
}
