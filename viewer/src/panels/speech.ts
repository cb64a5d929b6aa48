// What a view says in words: a warning that is seen, and one sentence for those who listen.
import { element, write } from "../base/dom";
import { CONTEXT_LOST, type Stage } from "../stage/stage";
import { Summary } from "./summary";

export class Speech {
  readonly warning = element("div", { class: "warning" });
  readonly summary = new Summary();
  private isBlind = false;
  private last: [string, string] = ["", ""];
  private beside = "";

  constructor(stage: Stage) {
    stage.onContext = (isLost) => {
      this.isBlind = isLost;
      this.show();
    };
  }

  /** Says how things stand, and what is the matter; empty where nothing is. */
  say(inShort: string, trouble: string): void {
    this.last = [inShort, trouble];
    this.also("");
  }

  /** Says what else is the matter, until something else is said or nothing else is the matter. */
  also(trouble: string): void {
    this.beside = trouble;
    this.show();
  }

  dispose(): void {
    this.summary.dispose();
  }

  private show(): void {
    const [inShort, trouble] = this.last;
    const sentence = this.isBlind ? CONTEXT_LOST : [trouble, this.beside].filter(Boolean).join(" ");
    this.warning.classList.toggle("is-shown", sentence !== "");
    if (sentence) write(this.warning, sentence);
    this.summary.say([inShort, sentence].filter(Boolean).join(" "));
  }
}
