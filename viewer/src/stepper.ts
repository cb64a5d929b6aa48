// The worker that steps a case in the page by the Rust stepper (bindings/wasm): it takes the bytes of a case and of the
// module, null where that is a file beside it, then one request after the other, and posts what the server would send.

interface Exports {
  memory: WebAssembly.Memory;
  page_allocate(len: number): number;
  page_release(bytes: number, len: number): void;
  page_message(): number;
  page_message_len(): number;
  case_open(bytes: number, len: number): number;
  case_answer(stepped: number, request: number, len: number): number;
  case_frame_len(stepped: number): number;
}

/** Only what is used of the worker's world; the page's own types describe a window. */
const page = self as unknown as {
  postMessage(data: string | ArrayBuffer, transfer?: Transferable[]): void;
  onmessage: (event: MessageEvent<[ArrayBuffer, ArrayBuffer | null] | string>) => void;
};

class Stepper {
  private constructor(
    private readonly wasm: Exports,
    private readonly stepped: number,
  ) {}

  /** Sets up a case; the stepper, and what it says of itself. */
  static async open(bytes: Uint8Array, module: ArrayBuffer | null): Promise<[Stepper, string]> {
    const clock = { page: { now: () => performance.now() } };
    const { instance } = await WebAssembly.instantiate(module ?? (await fetched("stepper.wasm")), clock);
    const wasm = instance.exports as unknown as Exports;
    const stepped = withinMemory(wasm, () => withBytes(wasm, bytes, (at) => wasm.case_open(at, bytes.length)));
    if (stepped === 0) throw new Error(message(wasm));
    return [new Stepper(wasm, stepped), message(wasm)];
  }

  /** The frame that a request asks for; throws a sentence where it cannot be followed. */
  answer(request: string): ArrayBuffer {
    const { wasm, stepped } = this;
    const bytes = new TextEncoder().encode(request);
    const frame = withinMemory(wasm, () => withBytes(wasm, bytes, (at) => wasm.case_answer(stepped, at, bytes.length)));
    if (frame === 0) throw new Refusal(message(wasm));
    return new Float32Array(wasm.memory.buffer, frame, wasm.case_frame_len(stepped)).slice().buffer;
  }
}

async function fetched(url: string): Promise<ArrayBuffer> {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  return response.arrayBuffer();
}

/** A request that was not followed. */
class Refusal extends Error {}

function withBytes<T>(wasm: Exports, bytes: Uint8Array, use: (at: number) => T): T {
  const at = wasm.page_allocate(bytes.length);
  new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
  const result = use(at);
  wasm.page_release(at, bytes.length);
  return result;
}

/** What `work` returns; where the module ends, a sentence that says why. */
function withinMemory<T>(wasm: Exports, work: () => T): T {
  try {
    return work();
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

page.onmessage = ({ data }) => {
  if (typeof data !== "string") {
    const [bytes, module] = data;
    Stepper.open(new Uint8Array(bytes), module).then(([opened, introduction]) => {
      stepper = opened;
      page.postMessage(introduction);
    }, refuse);
    return;
  }
  try {
    const frame = stepper!.answer(data);
    page.postMessage(frame, [frame]);
  } catch (error) {
    // What is no refusal is a fault of the stepper: it reaches the page as an error of its worker.
    if (!(error instanceof Refusal)) throw error;
    refuse(error);
  }
};

export {};
