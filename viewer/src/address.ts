// A touch in an address: #touch=x,y,z;dx,dy,dz&order=4&colour=displacement&look=cut&from=x,y,z, lengths in millimetres.
import type { Vec3 } from "./evaluator";

/** What an address carries; what it leaves out stays as it is. */
export interface Carried {
  point?: Vec3;
  displacement?: Vec3;
  order?: number;
  colour?: string;
  look?: string;
  /** Where the camera stands [diagonals]. */
  from?: Vec3;
}

/** What follows the #. */
export function written({ point, displacement, order, colour, look, from }: Carried): string {
  const said = new URLSearchParams();
  if (point && displacement) said.set("touch", `${listed(point, 1000, 3)};${listed(displacement, 1000, 3)}`);
  if (order) said.set("order", String(order));
  if (colour) said.set("colour", colour);
  if (look) said.set("look", look);
  if (from) said.set("from", listed(from, 1, 4));
  return decodeURIComponent(said.toString());
}

/** What an address says after its #; what makes no sense is left out. */
export function read(hash: string): Carried {
  const said = new URLSearchParams(hash.replace(/^#/, ""));
  const carried: Carried = {};
  const [point, displacement] = (said.get("touch") ?? "").split(";").map((text) => numbers(text, 1000));
  if (point && displacement) Object.assign(carried, { point, displacement });
  const order = Number(said.get("order"));
  if (Number.isInteger(order) && order > 0) carried.order = order;
  for (const name of ["colour", "look"] as const) if (said.get(name)) carried[name] = said.get(name)!;
  const from = numbers(said.get("from") ?? "", 1);
  if (from && Math.hypot(...from) > 0.1) carried.from = from;
  return carried;
}

function listed(vector: Vec3, unit: number, decimals: number): string {
  return vector.map((x) => String(Number((unit * x).toFixed(decimals)))).join(",");
}

function numbers(text: string, unit: number): Vec3 | null {
  const found = text.split(",").map((part) => (part.trim() ? Number(part) / unit : NaN));
  return found.length === 3 && found.every(Number.isFinite) ? (found as Vec3) : null;
}
