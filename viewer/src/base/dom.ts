// Small helpers for building the controls.
type Content = Node | string;

/** An element with attributes and content. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...content: Content[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...content);
  return made;
}

/** A button with a hint. What is written on it is its name; a sign alone has the hint for a name. */
export function button(label: string, title: string, press: () => void, key = ""): HTMLButtonElement {
  const hint = key ? `${title} (${key})` : title;
  const made = element("button", { type: "button", title: hint }, label);
  if (!/\p{Letter}/u.test(label)) made.setAttribute("aria-label", title);
  if (key) made.setAttribute("aria-keyshortcuts", key);
  made.addEventListener("click", press);
  return made;
}

/** A drop-down list; without a label of its own where it stands inside of one. */
export function choice(label: string, options: readonly [string, string][], choose: (value: string) => void): HTMLSelectElement {
  const made = element("select", label ? { "aria-label": label, title: label } : {});
  for (const [value, text] of options) made.append(element("option", { value }, text));
  made.addEventListener("change", () => choose(made.value));
  return made;
}

/** Gives a view the system's theme, and follows it until one is chosen; returns what ends that. */
export function followTheme(root: HTMLElement, changed: () => void): () => void {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const follow = () => {
    if (root.dataset.isChosen) return;
    root.dataset.theme = system.matches ? "dark" : "light";
    changed();
  };
  follow();
  system.addEventListener("change", follow);
  return () => system.removeEventListener("change", follow);
}

/** Turns a view from light to dark or back. */
export function toggleTheme(root: HTMLElement): void {
  root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  root.dataset.isChosen = "true";
}

/** The dialog that lists keys and gestures; a press beside it closes it. */
export function helpDialog(title: string, keys: readonly [string, string][]): HTMLDialogElement {
  const list = element("dl");
  for (const [key, meaning] of keys) list.append(element("dt", {}, key), element("dd", {}, meaning));
  const dialog = element("dialog", { class: "help", "aria-label": "keys and gestures" });
  // Without it the browser would go to the button at the end, and a long list would open there.
  const heading = element("h2", { tabindex: "-1", autofocus: "" }, title);
  dialog.append(heading, list, button("Close", "close", () => dialog.close(), "Esc"));
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  return dialog;
}

/** Writes words where others stand; the browser lays out nothing anew where they are the same. */
export function write(place: HTMLElement, words: string): void {
  if (place.textContent !== words) place.textContent = words;
}

/** A number beside its name. */
export function fact(name: string, value: HTMLElement): HTMLElement {
  return element("div", {}, element("dt", {}, name), element("dd", {}, value));
}

/** A few exclusive choices side by side. */
export class Segments<T extends string> {
  readonly root: HTMLDivElement;
  private readonly buttons = new Map<T, HTMLButtonElement>();

  constructor(label: string, options: readonly [T, string, string][], choose: (value: T) => void) {
    this.root = element("div", { class: "segments", role: "group", "aria-label": label });
    for (const [value, text, title] of options) {
      const made = button(text, title, () => choose(value));
      this.buttons.set(value, made);
      this.root.append(made);
    }
  }

  set value(chosen: T) {
    for (const [value, made] of this.buttons) made.setAttribute("aria-pressed", String(value === chosen));
  }
}

/** A number with so many significant digits, but decimals at most, never in exponents, with a true minus sign. */
export function digits(value: number, count: number, most = 12): string {
  if (!Number.isFinite(value)) return "–";
  const decimals = value === 0 ? count - 1 : Math.max(0, decimalsOf(value, count));
  return fixed(value, Math.min(decimals, most));
}

/** Decimals that give a number other than 0 so many significant digits; below 0 where it has more before the point. */
export function decimalsOf(value: number, count: number): number {
  return count - 1 - Math.floor(Math.log10(Math.abs(value)));
}

/** A number with so many decimals and a true minus sign. */
export function fixed(value: number, decimals: number): string {
  return value.toFixed(decimals).replace(/^-(0(\.0*)?)$/, "$1").replace("-", "−");
}

/** A length as it is read at a glance. */
export function millimetres(length: number): string {
  return `${Number((1000 * length).toPrecision(3))} mm`;
}

/** A depth or a distance as it is read at a glance: with one decimal, and with two digits at least, however small. */
export function depthInWords(length: number): string {
  const shown = 1000 * length;
  const isSmall = shown > 1e-6 && shown < 0.95;
  return `${fixed(shown, isSmall ? decimalsOf(shown, 2) : 1)} mm`;
}

/** A force up to this is rounding [N]. */
const NOTHING = 1e-8;

/** A force in newtons with so many significant digits, however small. */
export function forceDigits(force: number, count: number): string {
  return digits(force > NOTHING ? force : 0, count);
}

/** A force as it is read at a glance: with two digits at least, however small. */
export function newtons(force: number): string {
  const isSmall = force > NOTHING && force < 0.00995;
  const decimals = isSmall ? decimalsOf(force, 2) : force < 0.0995 ? 3 : force < 9.995 ? 2 : force < 999.5 ? 1 : 0;
  return `${fixed(force, decimals)} N`;
}

/** A share as a percentage. */
export function percent(share: number): string {
  return `${digits(100 * share, 2, 4)} %`;
}
