// What is taken along: a picture, a short film, an address that carries the touch.
import { button, element } from "../base/dom";
import type { Stage } from "../stage/stage";

/** A film ends after so many seconds by itself, and has so many frames in each. */
const LONGEST = 20;
const RATE = 30;

/** What a view tells of itself. */
export interface Shared {
  readonly title: string;
  /** Says a sentence to those who listen. */
  announce(sentence: string): void;
  /** What stands below a picture: how things are, and what is not to be relied on. */
  caption(): string;
  /** What follows the # of an address that carries the touch; none where a view has no such address. */
  hash?(): string;
}

export class Share {
  readonly root: HTMLElement;
  /** Frames of the present film, or of the last. */
  frames = 0;
  /** What became of it. */
  private readonly outcome = element("div", { class: "outcome" });
  private readonly filming: HTMLButtonElement;
  private recorder: MediaRecorder | null = null;

  constructor(
    private readonly stage: Stage,
    private readonly shared: Shared,
    private readonly ground: HTMLElement,
  ) {
    this.filming = button("Film", "start or stop recording a film", () => this.film());
    const link = button("Link", "copy a link to this touch", () => void this.link());
    link.hidden = !shared.hash;
    this.root = element(
      "details",
      { class: "share" },
      element("summary", { "aria-label": "save or share", title: "save a picture, record a film, copy a link" }, "⤓"),
      element("div", { class: "panel" }, button("Picture", "save a picture", () => void this.picture()), this.filming, link, this.outcome),
    );
    this.filming.hidden = typeof MediaRecorder === "undefined";
  }

  /** The organ as it is seen, on its ground and with its caption, as a canvas. */
  drawn(): HTMLCanvasElement {
    this.stage.drawSharply();
    const picture = this.blank();
    this.compose(picture, this.stage.fullRatio);
    return picture;
  }

  dispose(): void {
    this.recorder?.stop();
  }

  /** A picture with all pixels that the organ may be drawn with. */
  private blank(): HTMLCanvasElement {
    const { canvas, fullRatio } = this.stage;
    const picture = element("canvas");
    picture.width = Math.max(Math.floor(canvas.clientWidth * fullRatio), 1);
    picture.height = Math.max(Math.floor(canvas.clientHeight * fullRatio), 1);
    return picture;
  }

  /** Draws the organ in the middle of a picture, as large as it fits, and its words, with a unit for a CSS pixel. */
  private compose(picture: HTMLCanvasElement, unit: number): void {
    const context = picture.getContext("2d")!;
    const { canvas } = this.stage;
    const style = getComputedStyle(this.ground);
    context.fillStyle = style.getPropertyValue("--panel").trim();
    context.fillRect(0, 0, picture.width, picture.height);
    // A film goes on where a window is made narrower, or a telephone is turned.
    const scale = Math.min(picture.width / canvas.width, picture.height / canvas.height);
    const [width, height] = [scale * canvas.width, scale * canvas.height];
    context.drawImage(canvas, 0.5 * (picture.width - width), 0.5 * (picture.height - height), width, height);
    context.fillStyle = style.getPropertyValue("--ink").trim();
    context.font = `${14 * unit}px ${style.fontFamily}`;
    const caption = [this.shared.title, this.shared.caption()].filter(Boolean).join(" · ");
    const lines = wrapped(caption, picture.width - 32 * unit, (words) => context.measureText(words).width);
    lines.reverse().forEach((line, k) => context.fillText(line, 16 * unit, picture.height - (16 + 19 * k) * unit));
  }

  private async picture(): Promise<void> {
    const drawn = this.drawn();
    const blob = await new Promise<Blob | null>((done) => drawn.toBlob(done, "image/png"));
    if (blob) this.save(blob, "png");
  }

  /** Begins a film, or ends it. */
  private film(): void {
    if (this.recorder) return this.recorder.stop();
    const picture = this.blank();
    const unit = this.stage.fullRatio;
    const recorder = new MediaRecorder(picture.captureStream(RATE));
    const parts: Blob[] = [];
    recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
    recorder.addEventListener("stop", () => {
      clearTimeout(end);
      this.stage.onDrawn = () => {};
      this.recorder = null;
      this.filming.setAttribute("aria-pressed", "false");
      const [kind = "video/webm"] = recorder.mimeType.split(";");
      this.save(new Blob(parts, { type: kind }), kind.replace("video/", ""));
    });
    // While the organ's drawing is there: a browser clears it once it has been shown.
    this.frames = 0;
    this.stage.onDrawn = () => {
      this.compose(picture, unit);
      this.frames += 1;
    };
    this.recorder = recorder;
    this.filming.setAttribute("aria-pressed", "true");
    this.outcome.textContent = "";
    recorder.start();
    this.stage.invalidate();
    const end = setTimeout(() => recorder.state === "recording" && recorder.stop(), 1000 * LONGEST);
  }

  private async link(): Promise<void> {
    const address = new URL(location.href);
    address.hash = this.shared.hash!();
    history.replaceState(null, "", address);
    try {
      await navigator.clipboard.writeText(address.href);
      this.tell("The link is copied. The address bar shows it too.");
    } catch {
      this.tell("The address of this page now contains the touch. Copy it from there.");
    }
  }

  private save(blob: Blob, ending: string): void {
    const url = URL.createObjectURL(blob);
    const name = `${this.shared.title.toLowerCase().replace(/[^\p{Letter}\d]+/gu, "-")}.${ending}`;
    element("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
    this.tell(`Saved as ${name}.`);
  }

  private tell(sentence: string): void {
    this.outcome.textContent = sentence;
    this.shared.announce(sentence);
  }
}

/** Words in lines that are no wider than a width; a word by itself may be. */
function wrapped(words: string, width: number, widthOf: (line: string) => number): string[] {
  const lines = [""];
  for (const word of words.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (widthOf(longer) <= width || lines.at(-1) === "") lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines;
}
