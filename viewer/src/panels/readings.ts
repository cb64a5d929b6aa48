// What is read off: the force, the curve, and what every order says about the same touch.
import { CurvePlot, type Curves } from "./curve";
import { button, depthInWords, digits, element, fact, fixed, forceDigits, newtons, percent, write } from "../base/dom";
import type { Distances } from "./doubt";

/** What one order of the series answers: force [N], relative volume change, how far it is from the highest order. */
export interface OrderReading extends Distances {
  force: number;
  volume: number;
}

/** What is read off of a touch: force [N], depth [m], stiffness (9) [N/m], estimated errors of force and shape. */
export interface TouchReading {
  force: number;
  depth: number;
  stiffness: number[];
  error: number;
  shapeError: number;
  isDoubtful: boolean;
}

export class Readings {
  readonly root: HTMLElement;
  private readonly force = element("span", { class: "force" }, "0.00");
  private readonly depth = element("span");
  private readonly error = element("span");
  private readonly shapeError = element("span");
  private readonly stiffness = element("span");
  private readonly rows: HTMLTableRowElement[] = [];
  private readonly plot: CurvePlot;

  constructor(order: number, chooseOrder: (order: number) => void) {
    const canvas = element("canvas", { class: "curve", role: "img", "aria-label": "force against depth, for each order" });
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
    const head = ["order", "force [N]", "volume [%]", "deviation [%]"].map((name) => element("th", { scope: "col" }, name));
    const facts = [fact("depth", this.depth), fact("stiffness", this.stiffness)];
    facts.push(fact("est. force error", this.error), fact("est. shape error", this.shapeError));
    const fold = button("Orders", "results of each order of the series", () => {
      fold.setAttribute("aria-expanded", String(this.root.classList.toggle("is-unfolded")));
    });
    fold.classList.add("fold");
    fold.setAttribute("aria-expanded", "false");
    this.root = element(
      "section",
      { class: "panel readings", "aria-label": "readings" },
      element("div", { class: "big" }, this.force, element("span", { class: "unit" }, "N")),
      element("dl", {}, ...facts),
      canvas,
      fold,
      element("table", { class: "orders" }, element("thead", {}, element("tr", {}, ...head)), body),
    );
    this.plot = new CurvePlot(canvas);
  }

  /** Shows a touch; null is nobody touching. */
  show(touch: TouchReading | null): void {
    write(this.force, touch ? newtons(touch.force).slice(0, -2) : "0.00");
    write(this.depth, touch ? depthInWords(touch.depth) : "–");
    write(this.error, touch ? percent(touch.error) : "–");
    write(this.shapeError, touch ? percent(touch.shapeError) : "–");
    const K = touch?.stiffness;
    write(this.stiffness, K ? `${digits((K[0]! + K[4]! + K[8]!) / 3, 3)} N/m` : "–");
    this.root.classList.toggle("is-doubtful", touch?.isDoubtful === true);
  }

  /** The row of one order; null where nobody touches. */
  showOrder(order: number, reading: OrderReading | null): void {
    const cells = this.rows[order - 1]!.cells;
    const isBest = order === this.rows.length;
    write(cells[1]!, reading ? forceDigits(reading.force, 3) : "–");
    write(cells[2]!, reading ? signed(100 * reading.volume) : "–");
    write(cells[3]!, reading && !isBest ? digits(100 * reading.off, 2, 4) : "–");
    cells[2]!.classList.toggle("is-wrong", reading !== null && Math.abs(reading.volume) > 0.01);
    cells[3]!.classList.toggle("is-wrong", reading !== null && !isBest && reading.off > 0.05);
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

function signed(value: number): string {
  return `${value > 0 ? "+" : ""}${fixed(value, 2)}`;
}
