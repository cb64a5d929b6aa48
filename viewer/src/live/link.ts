// What steps a case: this machine behind a web socket, or a worker of this page. Both take the same requests and give the
// same frames (live/src/lib.rs).
import { absent, address, embedded } from "../model/files";

/** Requests go out, the introduction and frames come in. */
export interface Link {
  /** Where the frames are made, in words. */
  readonly place: string;
  readonly isOpen: boolean;
  onMessage: (data: string | ArrayBuffer) => void;
  /** The stepper is gone; the sentence says what to do. */
  onClose: (sentence: string) => void;
  send(request: string): void;
  close(): void;
}

/** The stepper of this machine. */
export class SocketLink implements Link {
  readonly place = "on this machine";
  onMessage: Link["onMessage"] = () => {};
  onClose: Link["onClose"] = () => {};
  private readonly socket: WebSocket;

  constructor(url: string) {
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
  isOpen = true;
  onMessage: Link["onMessage"] = () => {};
  onClose: Link["onClose"] = () => {};
  private readonly worker: Worker;

  /** Takes the bytes of a case over. */
  constructor(bytes: ArrayBuffer) {
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

/** A request, or in words what the kernel says; frames come as buffers. */
interface Message {
  request?: string;
  words?: string;
}

/** A stepper in the kernel of a notebook. */
export class KernelLink implements Link {
  readonly place = "in the kernel";
  isOpen = true;
  onMessage: Link["onMessage"] = () => {};
  onClose: Link["onClose"] = () => {};
  private readonly listen = ({ words }: Message, buffers: DataView[]) => {
    if (words !== undefined) return this.onMessage(words);
    const [frame] = buffers;
    if (frame) this.onMessage(frame.buffer.slice(frame.byteOffset, frame.byteOffset + frame.byteLength) as ArrayBuffer);
  };

  constructor(private readonly kernel: Kernel) {
    kernel.on?.("msg:custom", this.listen);
    // The kernel introduces itself to whoever asks for nothing.
    kernel.send?.({ request: "" });
  }

  send(request: string): void {
    this.kernel.send?.({ request });
  }

  close(): void {
    this.isOpen = false;
    this.kernel.off?.("msg:custom", this.listen);
  }
}
