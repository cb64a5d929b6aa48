// The worker that steps a case in the page by the Rust stepper (bindings/wasm): it takes the bytes of a case and of the
// module, null where that is a file beside it, and what the page's address wants of the graphics processor; then one
// request after the other, and posts what the server would send.

import { Device, type Wish } from "./gpu";

interface Exports {
  memory: WebAssembly.Memory;
  page_allocate(len: number): number;
  page_release(bytes: number, len: number): void;
  page_message(): number;
  page_message_len(): number;
  case_open(bytes: number, len: number, cellsOnDevice: number): number;
  case_answer(stepped: number, request: number, len: number): number;
  case_frame_len(stepped: number): number;
}

/** Only what is used of the worker's world; the page's own types describe a window. */
const page = self as unknown as {
  postMessage(data: string | ArrayBuffer, transfer?: Transferable[]): void;
  onmessage: (event: MessageEvent<[ArrayBuffer, ArrayBuffer | null, Wish] | string>) => void;
};

class Stepper {
  private constructor(
    private readonly wasm: Exports,
    private readonly stepped: number,
    private readonly step: (...numbers: number[]) => Promise<number>,
  ) {}

  /** Sets up a case; the stepper, and what it says of itself. */
  static async open(bytes: Uint8Array, module: ArrayBuffer | null, wish: Wish): Promise<[Stepper, string]> {
    const device = new Device(wish);
    const imports = { page: { now: () => performance.now() }, gpu: device.imports };
    const { instance } = await WebAssembly.instantiate(module ?? (await fetched("stepper.wasm")), imports).catch(damaged);
    const wasm = instance.exports as unknown as Exports;
    device.serve(wasm.memory);
    const open = device.waiting(wasm.case_open);
    const stepped = await withinMemory(wasm, () => withBytes(wasm, bytes, (at) => open(at, bytes.length, device.leastCells)));
    if (stepped === 0) throw new Error(message(wasm));
    const hello = message(wasm);
    const introduction = JSON.stringify({ ...JSON.parse(hello), device: device.inUse, refusal: device.refusal });
    return [new Stepper(wasm, stepped, device.waiting(wasm.case_answer)), introduction];
  }

  /** The frame that a request asks for, and news if there are any; rejects with a sentence where it cannot be followed. */
  async answer(request: string): Promise<[ArrayBuffer, string]> {
    const { wasm, stepped } = this;
    const bytes = new TextEncoder().encode(request);
    const frame = await withinMemory(wasm, () => withBytes(wasm, bytes, (at) => this.step(stepped, at, bytes.length)));
    if (frame === 0) throw new Refusal(message(wasm));
    return [new Float32Array(wasm.memory.buffer, frame, wasm.case_frame_len(stepped)).slice().buffer, message(wasm)];
  }
}

async function fetched(url: string): Promise<ArrayBuffer> {
  // The words of viewer/src/model/files.ts, with which this script shares no code.
  const response = await fetch(url).catch(() => {
    throw new Error(`${url} did not arrive; see that its server runs and is not blocked, then reload this page`);
  });
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  return response.arrayBuffer();
}

/** In place of the browser's own words for a module that is no whole one. */
function damaged(error: unknown): never {
  throw new Error("stepper.wasm is cut or damaged; load this page again, or copy its folder anew", { cause: error });
}

/** A request that was not followed. */
class Refusal extends Error {}

async function withBytes<T>(wasm: Exports, bytes: Uint8Array, use: (at: number) => Promise<T>): Promise<T> {
  const at = wasm.page_allocate(bytes.length);
  new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
  const result = await use(at);
  wasm.page_release(at, bytes.length);
  return result;
}

/** What `work` returns; where the module ends, a sentence that says why. */
async function withinMemory<T>(wasm: Exports, work: () => Promise<T>): Promise<T> {
  try {
    return await work();
  } catch (error) {
    if (!(error instanceof WebAssembly.RuntimeError)) throw error;
    // A fault leaves its place in the message (bindings/wasm/src/stepper.rs); an allocation that fails leaves none.
    const fault = message(wasm);
    if (fault.includes("panicked")) throw new Error(fault);
    throw new Error(
      "the organ needs more memory than this browser gives a page; viscera view without --export steps it on your machine",
    );
  }
}

function message(wasm: Exports): string {
  return new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, wasm.page_message(), wasm.page_message_len()));
}

function refuse(error: unknown): void {
  page.postMessage(JSON.stringify({ error: error instanceof Error ? error.message : String(error) }));
}

let stepper: Stepper | null = null;

async function begin(bytes: ArrayBuffer, module: ArrayBuffer | null, wish: Wish): Promise<void> {
  const [opened, introduction] = await Stepper.open(new Uint8Array(bytes), module, wish);
  stepper = opened;
  page.postMessage(introduction);
}

async function follow(request: string): Promise<void> {
  const [frame, news] = await stepper!.answer(request);
  if (news) page.postMessage(JSON.stringify({ news }));
  page.postMessage(frame, [frame]);
}

/** The request before: one at a time, as the module may be waiting for the graphics processor. */
let last: Promise<void> = Promise.resolve();

page.onmessage = ({ data }) => {
  if (typeof data !== "string") {
    begin(...data).catch(refuse);
    return;
  }
  last = last.then(() => follow(data)).catch((error: unknown) => {
    if (error instanceof Refusal) return refuse(error);
    // What is no refusal is a fault of the stepper: it reaches the page as an error of its worker.
    setTimeout(() => {
      throw error;
    });
  });
};

export {};
