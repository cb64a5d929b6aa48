// A sentence where a view will be, or cannot be.
import { element, followTheme } from "../base/dom";
import style from "../style/index.css?inline";

export class Notice {
  private readonly host = element("div", { style: "position:absolute;inset:0" });
  private readonly words = element("p", { class: "notice", role: "status" });
  private readonly deaf: () => void;

  constructor(place: HTMLElement, sentence: string) {
    const root = element("div", { class: "view" }, this.words);
    this.deaf = followTheme(root, () => {});
    this.host.attachShadow({ mode: "open" }).append(element("style", {}, style), root);
    place.append(this.host);
    this.say(sentence);
  }

  say(sentence: string): void {
    this.words.textContent = sentence;
  }

  remove(): void {
    this.deaf();
    this.host.remove();
  }
}

/** The sentence of an error, for whoever looks at the page. */
export function inWords(error: unknown): string {
  return `The organ cannot be shown: ${sentenceOf(error)}`;
}

export function sentenceOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
