// A touch in an address: #touch=x,y,z;dx,dy,dz&order=4&stiffness=2&colour=displacement&look=cut&from=x,y,z, lengths in
// millimetres.
import { COLOURINGS, type Colouring } from "./colouring";
import { decimalsOf } from "../base/dom";
import type { Vec3 } from "../model/evaluator";
import { LOOKINGS, type Looking } from "../stage/sight";
import type { View } from "./view";

const ELSEWHERE = "This link touches a place that is not on the touchable surface.";
const AT_REST = "The organ is shown at rest.";
/** Of what could not be read so many letters are said. */
const SAID = 40;

/** No address multiplies stiffnesses by more, or divides them by more. */
const STIFFEST = 1000;

/** What an address carries; what it leaves out stays as it is. */
interface Carried {
  point?: Vec3;
  displacement?: Vec3;
  order?: number;
  /** All stiffnesses of the organ, in units of its own. */
  stiffness?: number;
  colour?: Colouring;
  look?: Looking;
  /** Where the camera stands [diagonals]. */
  from?: Vec3;
}

/** What each part of an address says; null where that makes no sense. */
const PARTS = new Map<string, (text: string) => Carried | null>([
  ["touch", readTouch],
  ["order", (text) => (/^[1-9]\d*$/.test(text) ? { order: Number(text) } : null)],
  ["stiffness", readStiffness],
  ["colour", (text) => readOneOf(COLOURINGS, text, (colour) => ({ colour }))],
  ["look", (text) => readOneOf(LOOKINGS, text, (look) => ({ look }))],
  ["from", readFrom],
]);

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
  const listener = () => follow(view, location.hash);
  listener();
  window.addEventListener("hashchange", listener);
  return () => window.removeEventListener("hashchange", listener);
}

function follow(view: View, hash: string): void {
  const { carried, lost } = read(hash, view.evaluator.about.metadata.order);
  const { point, displacement, order, stiffness, colour, look, from } = carried;
  if (order) view.setOrder(order);
  if (stiffness) view.setStiffness(stiffness);
  if (colour) view.setColouring(colour);
  if (from) view.stage.lookFrom(from);
  if (look) view.sight.choose(look);
  const trouble = lost.size > 0 ? [inWords(lost)] : [];
  if (point && displacement && view.evaluator.touch(point)) view.touch(point, displacement);
  else if (point || lost.has("touch")) {
    view.rest();
    trouble.push(...(point ? [ELSEWHERE] : []), AT_REST);
  }
  view.display.speech.also(trouble.join(" "));
}

/** Says which parts of an address could not be read. */
function inWords(lost: ReadonlyMap<string, string>): string {
  const parts = Array.from(lost, ([name, text]) => (text ? `${name}=${text}` : name));
  const said = parts.map((part) => (part.length > SAID ? `${part.slice(0, SAID)}…` : part));
  return `This link could not be read where it says ${said.join(", ")}.`;
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

/** What an address says after its #, to a model of a highest order, and by name the parts that make no sense. */
function read(hash: string, highest: number): { carried: Carried; lost: Map<string, string> } {
  const carried: Carried = {};
  const lost = new Map<string, string>();
  for (const [name, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const found = PARTS.get(name)?.(text);
    if (found && (found.order ?? 1) <= highest) Object.assign(carried, found);
    else lost.set(name, text);
  }
  return { carried, lost };
}

function readTouch(text: string): Carried | null {
  const [point, displacement, ...more] = text.split(";").map((part) => numbers(part, 1000));
  return point && displacement && more.length === 0 ? { point, displacement } : null;
}

function readStiffness(text: string): Carried | null {
  const stiffness = Number(text);
  return stiffness >= 1 / STIFFEST && stiffness <= STIFFEST ? { stiffness } : null;
}

function readFrom(text: string): Carried | null {
  const from = numbers(text, 1);
  return from && Math.hypot(...from) > 0.1 ? { from } : null;
}

function readOneOf<Name extends string>(names: readonly Name[], text: string, carry: (name: Name) => Carried): Carried | null {
  const name = names.find((known) => known === text);
  return name ? carry(name) : null;
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
