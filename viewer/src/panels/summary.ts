// What is said aloud: one sentence once something rests, not the numbers of every frame.
import { element } from "../base/dom";

/** So long nothing may change before it is said [ms]. */
const PAUSE = 700;

export class Summary {
  /** The only live region of a view. */
  readonly root = element("p", { class: "unseen", role: "status" });
  private waiting = 0;
  private next = "";

  /** What is to be heard now; a later sentence takes the place of one that has not been said. */
  say(sentence: string): void {
    if (sentence === this.next) return;
    this.next = sentence;
    clearTimeout(this.waiting);
    this.waiting = window.setTimeout(() => (this.root.textContent = sentence), PAUSE);
  }

  dispose(): void {
    clearTimeout(this.waiting);
  }
}
