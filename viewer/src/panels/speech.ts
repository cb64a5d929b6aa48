// What a view says in words: a warning that is seen, and one sentence for those who listen.
import { element, write } from "../base/dom";
import { CONTEXT_LOST, type Stage } from "../stage/stage";
import { Summary } from "./summary";

export class Speech {
  readonly warning = element("div", { class: "warning" });
  readonly summary = new Summary();
  private isBlind = false;
  private last: [string, string] = ["", ""];

  constructor(stage: Stage) {
    stage.onContext = (isLost) => {
      this.isBlind = isLost;
      this.say(...this.last);
    };
  }

  /** Says how things stand, and what is the matter; empty where nothing is. */
  say(inShort: string, trouble: string): void {
    this.last = [inShort, trouble];
    const sentence = this.isBlind ? CONTEXT_LOST : trouble;
    this.warning.classList.toggle("is-shown", sentence !== "");
    if (sentence) write(this.warning, sentence);
    this.summary.say([inShort, sentence].filter(Boolean).join(" "));
  }

  /** Says what else is the matter, until something else is said. */
  also(trouble: string): void {
    const [inShort, before] = this.last;
    this.say(inShort, [before, trouble].filter(Boolean).join(" "));
  }

  dispose(): void {
    this.summary.dispose();
  }
}
