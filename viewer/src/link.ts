// What steps a case: this machine behind a web socket, or a worker of this page. Both take the same requests and give the
// same frames (live/src/lib.rs).
import { address, embedded } from "./files";

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
      this.onClose(`The stepper has stopped (${event.message}). Reload this page.`);
    });
    this.worker.postMessage([bytes, embedded("stepper.wasm")?.buffer ?? null]);
  }

  send(request: string): void {
    this.worker.postMessage(request);
  }

  close(): void {
    this.isOpen = false;
    this.worker.terminate();
  }
}
