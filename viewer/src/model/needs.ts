// What a page needs of its browser, each with what it is for.
const NEEDS = {
  WebAssembly: "which computes how the organ responds",
  Worker: "in which the organ is stepped",
  WebSocket: "by which the page speaks with the stepper",
} as const;

/** Throws a sentence for what a browser does not offer, or has been told not to. */
export function requireOf(...names: (keyof typeof NEEDS)[]): void {
  const missing = names.find((name) => !(name in globalThis));
  if (!missing) return;
  throw new Error(`this browser offers no ${missing}, ${NEEDS[missing]}; allow it for this page, or use a newer browser`);
}
