// The keyboard: everything a hand can do.
import type { Stage } from "../stage/stage";

/** A key turns the view by so much [rad], and zooms by this factor. */
const TURN = Math.PI / 12;
const ZOOM = 1.15;

/** What keys do to a view; a view that knows no orders, paths or modes leaves those out. */
export interface Keyed {
  touchMiddle(): void;
  /** By parts of the depth: along the screen's axes and along the inward normal. */
  nudge(right: number, up: number, inward: number): void;
  rest(): void;
  nextColouring(): void;
  toggleOutline(): void;
  toggleProbe(): void;
  toggleTheme(): void;
  /** Lets go and looks from where it looked first. */
  reset(): void;
  readonly help: HTMLDialogElement;
  readonly stage: Pick<Stage, "turn" | "zoom">;
  /** The menu of pictures. */
  readonly share: { readonly root: HTMLElement };
  nextLook(): void;
  setOrder?(order: number): void;
  toggleKeeping?(): void;
  togglePath?(): void;
  toggleModes?(): void;
  stepMode?(by: number): void;
}

/** Keys and what they do, for the help. */
export const KEYS: readonly [string, string][] = [
  ["drag on the organ", "push it in (down) or pull it out (up); Shift switches push and drag"],
  ["wheel while holding", "push in or pull out along the normal"],
  ["two fingers on it", "touch it with two hands; with the probe, one in each"],
  ["drag beside it", "turn the view; zoom with the wheel or with two fingers"],
  ["Enter", "touch the middle"],
  ["↑ ↓ ← →", "move the contact; Shift for small steps"],
  ["+ −", "push in, pull out"],
  ["Esc", "let go, close this help or the menu"],
  ["E  S  D  X", "look from above, the left, the right, below; Z zooms in, Shift and Z out"],
  ["1 … 8", "order of the series; 1 is linear theory"],
  ["C  W  K", "colour, wireframe at rest, keep the touch"],
  ["F  I", "take a probe, or the contact itself; look: solid, translucent, cut open"],
  ["P  M", "play a load path, show the modes ([ and ] step through them)"],
  ["T  R  ?", "light or dark theme, reset, this help"],
];

/** The same where a case is stepped. */
export const LIVE_KEYS: readonly [string, string][] = [
  ["drag on the organ", "take hold and drag in the plane of the screen; Shift switches to push and pull"],
  ["wheel while holding", "push in or pull out along the normal"],
  ["two fingers on it", "take hold with two hands"],
  ["drag beside it", "turn the view; zoom with the wheel or with two fingers"],
  ["Enter", "take hold of the middle"],
  ["↑ ↓ ← →", "move the hand; Shift for small steps"],
  ["+ −", "push in, pull out"],
  ["Esc", "let go, close this help or the menu"],
  ["E  S  D  X", "look from above, the left, the right, below; Z zooms in, Shift and Z out"],
  ["C  W", "colour, wireframe at rest"],
  ["F  I", "forces: arrows or probes; look: solid, translucent, cut open"],
  ["T  R  ?", "light or dark theme, reset, this help"],
];

/** The same of a solved state, which is only looked at. */
export const STILL_KEYS: readonly [string, string][] = [
  ["drag", "turn the view; zoom with the wheel or with two fingers"],
  ["E  S  D  X", "look from above, the left, the right, below; Z zooms in, Shift and Z out"],
  ["C  W", "colour, wireframe at rest"],
  ["I", "look: solid, translucent, cut open"],
  ["T  R  ?", "light or dark theme, reset the view, this help"],
];

/** Listens wherever in the view the focus is; returns what ends it. */
export function listen(root: HTMLElement, view: Keyed): () => void {
  const act = (event: KeyboardEvent): boolean => {
    // Many keyboards have + and _ with Shift, which then asks for nothing else.
    const isSmall = event.shiftKey && event.key !== "+" && event.key !== "_";
    const step = isSmall ? 0.01 : 0.05;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    // Over the help keys mean nothing else than to close it.
    if (view.help.open) {
      if (key === "Escape" || key === "?") view.help.close();
      return key === "Escape" || key === "?";
    }
    if (/^[1-8]$/.test(key)) view.setOrder?.(Number(key));
    else if (key === "Enter") view.touchMiddle();
    else if (key === "ArrowLeft") view.nudge(-step, 0, 0);
    else if (key === "ArrowRight") view.nudge(step, 0, 0);
    else if (key === "ArrowUp") view.nudge(0, step, 0);
    else if (key === "ArrowDown") view.nudge(0, -step, 0);
    else if (key === "+" || key === "=" || key === "PageDown") view.nudge(0, 0, step);
    else if (key === "-" || key === "_" || key === "PageUp") view.nudge(0, 0, -step);
    else if (key === "Escape") leave(view);
    else if (key === "e") view.stage.turn(0, TURN);
    else if (key === "x") view.stage.turn(0, -TURN);
    else if (key === "s") view.stage.turn(-TURN, 0);
    else if (key === "d") view.stage.turn(TURN, 0);
    else if (key === "z") view.stage.zoom(event.shiftKey ? 1 / ZOOM : ZOOM);
    else if (key === "c") view.nextColouring();
    else if (key === "w") view.toggleOutline();
    else if (key === "f") view.toggleProbe();
    else if (key === "i") view.nextLook();
    else if (key === "k") view.toggleKeeping?.();
    else if (key === "p") view.togglePath?.();
    else if (key === "m") view.toggleModes?.();
    else if (key === "[") view.stepMode?.(-1);
    else if (key === "]") view.stepMode?.(1);
    else if (key === "t") view.toggleTheme();
    else if (key === "r") view.reset();
    else if (key === "?") view.help.showModal();
    else return false;
    return true;
  };
  const listener = (event: KeyboardEvent) => {
    root.classList.add("has-keys");
    // Sliders and lists need their own keys, and what is pressed its Enter.
    const control = event.target instanceof Element ? event.target.tagName : "";
    if (control === "INPUT" || control === "SELECT") return;
    if (event.key === "Enter" && (control === "BUTTON" || control === "SUMMARY")) return;
    if (act(event)) event.preventDefault();
  };
  root.addEventListener("keydown", listener);
  return () => root.removeEventListener("keydown", listener);
}

/** Closes the menu of pictures where it is open, and gives the focus back to what opens it; lets go elsewhere. */
function leave(view: Keyed): void {
  const { root } = view.share;
  if (!root.hasAttribute("open")) return view.rest();
  root.removeAttribute("open");
  root.querySelector("summary")?.focus();
}
