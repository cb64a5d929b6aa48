// What steps a case: this machine behind a web socket, or a worker of this page. Both take the same requests and give the
// same frames (live/src/lib.rs).
import { absent, address, embedded } from "../model/files";
import { requireOf } from "../model/needs";
import type { Hand } from "./specimen";

/** What hands hold that are not this view's: of Python, or of another view of the same organ. */
export interface Others {
  /** Whether they are another view's. */
  isElsewhere: boolean;
  hands: readonly (Omit<Hand, "normal"> | null)[];
}

/** Requests go out, the introduction and frames come in. */
export interface Link {
  /** Where the frames are made, in words. */
  readonly place: string;
  /** What is said while an answer is overdue. */
  readonly silence: string;
  readonly isOpen: boolean;
  /** With a frame come the hands that are not this view's, if any hold it; and whether it answers another view. */
  onMessage: (data: string | ArrayBuffer, others?: Others | null, isAnswer?: boolean) => void;
  /** The stepper is gone; the sentence says what to do. */
  onClose: (sentence: string) => void;
  send(request: string): void;
  close(): void;
}

/** The stepper of this machine. */
export class SocketLink implements Link {
  readonly place = "on this machine";
  readonly silence = "The stepper does not answer. See whether viscera view still runs.";
  onMessage: Link["onMessage"] = () => {};
  onClose: Link["onClose"] = () => {};
  private readonly socket: WebSocket;

  constructor(url: string) {
    requireOf("WebSocket");
    const address = new URL(url, location.href);
    address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.addEventListener("message", (event) => this.onMessage(event.data as string | ArrayBuffer));
    this.socket.addEventListener("close", () => this.onClose("The connection to the stepper is lost. Start viscera view again."));
  }

  get isOpen(): boolean {
    return this.socket.readyState === WebSocket.OPEN;
  }

  send(request: string): void {
    this.socket.send(request);
  }

  close(): void {
    this.onClose = () => {};
    this.socket.close();
  }
}

/** The stepper in a worker of this page, so that the page never waits for it. */
export class WorkerLink implements Link {
  readonly place = "in this page";
  readonly silence = "The stepper does not answer. If it stays so, reload this page.";
  isOpen = true;
  onMessage: Link["onMessage"] = () => {};
  onClose: Link["onClose"] = () => {};
  private readonly worker: Worker;

  /** Takes the bytes of a case over. */
  constructor(bytes: ArrayBuffer) {
    requireOf("WebAssembly", "Worker");
    // Beside the page: a file of its own, which only pages that step a case load. No module, as a browser runs none in
    // a worker of a page from a disk.
    this.worker = new Worker(address("stepper.js"));
    this.worker.addEventListener("message", (event) => this.onMessage(event.data as string | ArrayBuffer));
    this.worker.addEventListener("error", (event) => {
      event.preventDefault();
      this.isOpen = false;
      // An event without words: the script itself did not come.
      this.onClose(event.message ? `The stepper has stopped (${event.message}). Reload this page.` : absent("stepper.js"));
    });
    const wish = new URLSearchParams(location.search).get("gpu");
    this.worker.postMessage([bytes, embedded("stepper.wasm")?.buffer ?? null, wish]);
  }

  send(request: string): void {
    this.worker.postMessage(request);
  }

  close(): void {
    this.isOpen = false;
    this.worker.terminate();
  }
}

/** The part of a widget's model that carries messages to the kernel of a notebook and back. */
export interface Kernel {
  on?(name: string, listen: (content: Message, buffers: DataView[]) => void): void;
  off?(name: string, listen: (content: Message, buffers: DataView[]) => void): void;
  send?(content: Message): void;
}

/** A request of a view; or, to all views, what the kernel answers to one of them in words, or beside a frame in a buffer. */
interface Message {
  view?: string;
  request?: string;
  words?: string;
  /** The view that holds the organ; null where Python does, or nobody. */
  holder?: string | null;
  hands?: Others["hands"];
}

/** A stepper in the kernel of a notebook. */
export class KernelLink implements Link {
  readonly place = "in the kernel";
  readonly silence = "The kernel does not answer. It may be at work on a cell; if it was restarted, run the cells again.";
  isOpen = true;
  onMessage: Link["onMessage"] = () => {};
  onClose: Link["onClose"] = () => {};
  /** A name among the views of this widget. */
  private readonly view = Math.random().toString(36).slice(2);
  private readonly listen = (message: Message, buffers: DataView[]) => {
    const isAnswer = message.view === this.view;
    if (message.words !== undefined) return isAnswer && this.onMessage(message.words);
    const [frame] = buffers;
    if (!frame) return;
    const numbers = frame.buffer.slice(frame.byteOffset, frame.byteOffset + frame.byteLength) as ArrayBuffer;
    this.onMessage(numbers, this.othersOf(message), isAnswer);
  };

  constructor(private readonly kernel: Kernel) {
    kernel.on?.("msg:custom", this.listen);
    // The kernel introduces itself to whoever asks for nothing.
    this.send("");
  }

  send(request: string): void {
    this.kernel.send?.({ view: this.view, request });
  }

  close(): void {
    this.isOpen = false;
    this.kernel.off?.("msg:custom", this.listen);
  }

  private othersOf({ holder = null, hands }: Message): Others | null {
    return hands && holder !== this.view ? { isElsewhere: holder !== null, hands } : null;
  }
}
