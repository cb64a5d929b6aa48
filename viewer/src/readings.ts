// What is read off: the force, the curve, and what every order says about the same touch.
import { CurvePlot, type Curves } from "./curve";
import { button, digits, element, fact, fixed, newtons } from "./dom";
import type { Answer } from "./evaluator";

/** What one order of the series answers: force [N], relative volume change, relative distance from the highest order. */
export interface OrderReading {
  force: number;
  volume: number;
  off: number;
}

export class Readings {
  readonly root: HTMLElement;
  private readonly force = element("span", { class: "force" }, "0.00");
  private readonly depth = element("span");
  private readonly error = element("span");
  private readonly stiffness = element("span");
  private readonly rows: HTMLTableRowElement[] = [];
  private readonly plot: CurvePlot;

  constructor(order: number, chooseOrder: (order: number) => void) {
    const canvas = element("canvas", { class: "curve", role: "img", "aria-label": "force against depth, for every order" });
    const body = element("tbody");
    for (let p = 1; p <= order; p++) {
      const pick = element("button", { type: "button", "aria-keyshortcuts": String(p) });
      pick.append(element("span", { class: "unseen" }, "order "), String(p), element("small", {}, p === 1 ? " linear" : ""));
      pick.addEventListener("click", () => chooseOrder(p));
      const row = element("tr", {}, element("th", { scope: "row" }, pick), ...[0, 1, 2].map(() => element("td", {}, "–")));
      row.addEventListener("click", () => chooseOrder(p));
      this.rows.push(row);
      body.append(row);
    }
    const head = ["order", "force [N]", "volume [%]", "off by [%]"].map((name) => element("th", { scope: "col" }, name));
    const fold = button("Orders", "what every order of the series says", () => {
      fold.setAttribute("aria-expanded", String(this.root.classList.toggle("is-unfolded")));
    });
    fold.classList.add("fold");
    fold.setAttribute("aria-expanded", "false");
    this.root = element(
      "section",
      { class: "panel readings", "aria-label": "readings" },
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, fact("depth", this.depth), fact("stiffness", this.stiffness), fact("est. error", this.error)),
      canvas,
      fold,
      element("table", { class: "orders" }, element("thead", {}, element("tr", {}, ...head)), body),
    );
    this.plot = new CurvePlot(canvas);
  }

  /** Shows a touch; null is nobody touching. */
  show(answer: Answer | null, force: number, depth: number): void {
    this.force.textContent = answer ? newtons(force).slice(0, -2) : "0.00";
    this.depth.textContent = answer ? `${fixed(1000 * depth, 1)} mm` : "–";
    this.error.textContent = answer ? errors(answer) : "–";
    const K = answer?.stiffness;
    this.stiffness.textContent = K ? `${digits((K[0]! + K[4]! + K[8]!) / 3, 3)} N/m` : "–";
    this.root.classList.toggle("is-doubtful", answer !== null && answer.trust !== "trusted");
  }

  /** The row of one order; null where nobody touches. */
  showOrder(order: number, reading: OrderReading | null): void {
    const cells = this.rows[order - 1]!.querySelectorAll("td");
    const isBest = order === this.rows.length;
    cells[0]!.textContent = reading ? digits(reading.force, 3) : "–";
    cells[1]!.textContent = reading ? signed(100 * reading.volume) : "–";
    cells[2]!.textContent = reading && !isBest ? digits(100 * reading.off, 2) : "–";
    cells[1]!.classList.toggle("is-wrong", reading !== null && Math.abs(reading.volume) > 0.01);
    cells[2]!.classList.toggle("is-wrong", reading !== null && !isBest && reading.off > 0.05);
  }

  choose(order: number): void {
    this.rows.forEach((row, k) => {
      row.classList.toggle("is-chosen", k === order - 1);
      row.querySelector("button")!.setAttribute("aria-pressed", String(k === order - 1));
    });
  }

  /** Draws the curves in the colours of another theme. */
  redraw(): void {
    this.plot.redraw();
  }

  dispose(): void {
    this.plot.dispose();
  }

  draw(curves: Curves | null, order: number, depth: number, now: { depth: number; force: number } | null): void {
    this.plot.draw(curves, order, depth, now);
  }
}

/** The estimated error of the force; and that of the shape, where the two differ in what is shown. */
function errors(answer: Answer): string {
  const [force, shape] = [percent(answer.error), percent(answer.shapeError)];
  return force === shape ? force : `${force}, shape ${shape}`;
}

export function percent(share: number): string {
  return `${digits(100 * share, 2)} %`;
}

function signed(value: number): string {
  return `${value > 0 ? "+" : ""}${fixed(value, 2)}`;
}
