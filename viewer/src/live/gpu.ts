// The graphics processor of a page, for the stepper's module: what gpu/src/driver/page.rs imports under the name `gpu`.
// Objects are numbers there. A call that waits suspends the module (JavaScript promise integration); a browser without
// that, or without WebGPU, has no device here, and the module steps on the processor.

/** From so many cells on, a graphics processor steps an organ faster than one thread of the processor (docs/gpu.md). */
const WORTHWHILE = 10_000;

/** What the page's address asks for: `?gpu=always` or `?gpu=never`; nothing, or what is neither, for where it pays. */
export type Wish = string | null;

/** Kinds of faults, as the module counts them. */
const [LOST, MEMORY, REFUSED] = [0, 1, 2];

/** Of JavaScript promise integration, which TypeScript does not know of. */
const { Suspending, promising } = WebAssembly as unknown as {
  Suspending?: new (work: (...numbers: number[]) => Promise<unknown>) => WebAssembly.ImportValue;
  promising?: (work: (...numbers: number[]) => number) => (...numbers: number[]) => Promise<number>;
};

// Of WebGPU, which TypeScript knows but for these.
declare const GPUBufferUsage: Record<"STORAGE" | "UNIFORM" | "COPY_SRC" | "COPY_DST" | "MAP_READ", number>;
declare const GPUMapMode: Record<"READ", number>;

/** A buffer that is kept while the module or a group has it. */
interface Held {
  buffer: GPUBuffer;
  holders: number;
}

/** Commands that are being written; the pass is open while kernels follow each other. */
interface Commands {
  encoder: GPUCommandEncoder;
  pass: GPUComputePassEncoder | null;
}

/** Objects by the numbers that the module knows them by. */
class Numbered<T> {
  private readonly objects = new Map<number, T>();
  private last = 0;

  add(object: T): number {
    this.objects.set(++this.last, object);
    return this.last;
  }

  get(number: number): T {
    return this.objects.get(number)!;
  }

  take(number: number): T {
    const object = this.get(number);
    this.objects.delete(number);
    return object;
  }
}

export class Device {
  private memory: WebAssembly.Memory | null = null;
  private device: GPUDevice | null = null;
  private isSoftware = false;
  private name = "";
  /** Why there is none, where one was asked for. */
  private lacks = "";
  /** The first fault, and its kind. */
  private fault: [string, number] | null = null;
  private readonly buffers = new Numbered<Held>();
  private readonly groups = new Numbered<[GPUBindGroup, Held[]]>();
  private readonly pipelines = new Numbered<GPUComputePipeline>();
  private readonly encoders = new Numbered<Commands>();
  /** Where results are read; it grows. */
  private staging: GPUBuffer | null = null;

  constructor(private readonly wish: Wish) {}

  /** Whether the browser has what it takes. */
  private get isPossible(): boolean {
    return Suspending !== undefined && navigator.gpu !== undefined && this.wish !== "never";
  }

  /** What the page's address asks for and does not get, in words. */
  get refusal(): string | null {
    const { wish, lacks } = this;
    if (wish === null || wish === "never" || this.inUse) return null;
    if (wish !== "always") return `"?gpu=${wish}" is unknown: always or never`;
    if (navigator.gpu === undefined) return "no graphics processor: this browser has no WebGPU here";
    if (Suspending === undefined) return "no graphics processor: this browser has no JavaScript promise integration";
    return `no graphics processor: ${lacks || "the organ cannot use it"}`;
  }

  /** From so many cells on, the module asks for the device. */
  get leastCells(): number {
    if (!this.isPossible) return 2 ** 32 - 1;
    return this.wish === "always" ? 0 : WORTHWHILE;
  }

  /** The name of the device that is open; null where there is none. */
  get inUse(): string | null {
    return this.device && this.name;
  }

  /** The module's memory, once there is one. */
  serve(memory: WebAssembly.Memory): void {
    this.memory = memory;
  }

  /** An exported function that may come to wait for the device. */
  waiting(work: (...numbers: number[]) => number): (...numbers: number[]) => Promise<number> {
    return this.isPossible ? promising!(work) : (...numbers) => Promise.resolve(work(...numbers));
  }

  /** The functions that the module imports. */
  get imports(): WebAssembly.ModuleImports {
    return {
      open: this.isPossible ? new Suspending!(() => this.open()) : () => 0,
      read: this.isPossible ? new Suspending!((...numbers) => this.read(...(numbers as [number, number, number, number]))) : () => {},
      is_software: () => Number(this.isSoftware),
      name: (at: number, room: number) => this.say(this.name, at, room),
      fault: (at: number, room: number) => (this.fault ? this.say(this.fault[0], at, room) : 0),
      fault_kind: () => this.fault?.[1] ?? LOST,
      destroy: () => this.destroy(),
      buffer: (bytes: number, isUniform: number) => this.buffer(bytes, isUniform !== 0),
      release_buffer: (buffer: number) => release(this.buffers.take(buffer)),
      write: (buffer: number, offset: number, at: number, length: number) => this.write(buffer, offset, at, length),
      pipeline: (at: number, length: number, entry: number, entryLength: number) =>
        this.pipeline(this.text(at, length), this.text(entry, entryLength)),
      bind: (pipeline: number, pairs: number, length: number) => this.bind(pipeline, this.pairs(pairs, length)),
      release_group: (group: number) => this.groups.take(group)[1].forEach(release),
      encoder: () => this.encoders.add({ encoder: this.device!.createCommandEncoder(), pass: null }),
      dispatch: (encoder: number, pipeline: number, group: number, workgroups: number) =>
        this.dispatch(this.encoders.get(encoder), pipeline, group, workgroups),
      submit: (encoder: number) => this.submit(this.encoders.take(encoder)),
    };
  }

  /** Opens the fastest device; returns its largest binding [bytes], zero where there is none or it is software. */
  private async open(): Promise<number> {
    // What is lost stays lost: the module goes on without.
    if (this.device) return 0;
    const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" }).catch(() => null);
    this.lacks = "the browser offers none";
    if (!adapter) return 0;
    const { info, limits } = adapter;
    this.isSoftware = info.isFallbackAdapter;
    if (this.isSoftware && this.wish !== "always") return 0;
    const { maxStorageBufferBindingSize, maxBufferSize } = limits;
    const request = adapter.requestDevice({ requiredLimits: { maxStorageBufferBindingSize, maxBufferSize } });
    const device = await request.catch((error: unknown) => {
      this.lacks = error instanceof Error ? error.message : String(error);
      return null;
    });
    if (!device) return 0;
    device.addEventListener("uncapturederror", ({ error }) => {
      const kind = error instanceof GPUOutOfMemoryError ? MEMORY : REFUSED;
      this.fault ??= [error.message, kind];
    });
    void device.lost.then(({ message }) => (this.fault ??= [message || "the browser does not say why", LOST]));
    this.name = info.description || [info.vendor, info.architecture].filter(Boolean).join(" ") || "a graphics processor";
    this.device = device;
    return Math.min(maxStorageBufferBindingSize, maxBufferSize);
  }

  private destroy(): void {
    this.fault ??= ["it was shut down", LOST];
    this.device?.destroy();
  }

  private buffer(size: number, isUniform: boolean): number {
    const { STORAGE, COPY_SRC, COPY_DST, UNIFORM } = GPUBufferUsage;
    const usage = COPY_DST | (isUniform ? UNIFORM : STORAGE | COPY_SRC);
    return this.buffers.add({ buffer: this.device!.createBuffer({ size, usage }), holders: 1 });
  }

  private write(buffer: number, offset: number, at: number, length: number): void {
    this.device!.queue.writeBuffer(this.buffers.get(buffer).buffer, offset, this.memory!.buffer, at, length);
  }

  private pipeline(code: string, entryPoint: string): number {
    const module = this.device!.createShaderModule({ code });
    return this.pipelines.add(this.device!.createComputePipeline({ layout: "auto", compute: { module, entryPoint } }));
  }

  private bind(pipeline: number, pairs: Uint32Array): number {
    const held: Held[] = [];
    const entries: GPUBindGroupEntry[] = [];
    for (let k = 0; k < pairs.length; k += 2) {
      const bound = this.buffers.get(pairs[k + 1]!);
      bound.holders += 1;
      held.push(bound);
      entries.push({ binding: pairs[k]!, resource: { buffer: bound.buffer } });
    }
    const layout = this.pipelines.get(pipeline).getBindGroupLayout(0);
    return this.groups.add([this.device!.createBindGroup({ layout, entries }), held]);
  }

  private dispatch(commands: Commands, pipeline: number, group: number, workgroups: number): void {
    const pass = (commands.pass ??= commands.encoder.beginComputePass());
    pass.setPipeline(this.pipelines.get(pipeline));
    pass.setBindGroup(0, this.groups.get(group)[0]);
    pass.dispatchWorkgroups(workgroups);
  }

  private submit({ encoder, pass }: Commands): void {
    pass?.end();
    this.device!.queue.submit([encoder.finish()]);
  }

  /** Submits, waits, and copies words of buffers to the module, one after the other. A fault is noted, not thrown. */
  private async read(number: number, pairsAt: number, length: number, to: number): Promise<void> {
    const commands = this.encoders.take(number);
    const pairs = this.pairs(pairsAt, length);
    commands.pass?.end();
    commands.pass = null;
    const size = 4 * pairs.reduce((words, word, k) => words + (k % 2 ? word : 0), 0);
    if (!this.staging || this.staging.size < size) {
      this.staging?.destroy();
      this.staging = this.device!.createBuffer({ size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
    }
    let at = 0;
    for (let k = 0; k < pairs.length; k += 2) {
      const bytes = 4 * pairs[k + 1]!;
      commands.encoder.copyBufferToBuffer(this.buffers.get(pairs[k]!).buffer, 0, this.staging, at, bytes);
      at += bytes;
    }
    this.submit(commands);
    try {
      await this.staging.mapAsync(GPUMapMode.READ, 0, size);
      new Uint8Array(this.memory!.buffer, to, size).set(new Uint8Array(this.staging.getMappedRange(0, size)));
      this.staging.unmap();
    } catch (error) {
      // Of a device that is lost, its own event says why.
      await Promise.resolve();
      this.fault ??= [error instanceof Error ? error.message : String(error), LOST];
    }
  }

  private pairs(at: number, length: number): Uint32Array {
    return new Uint32Array(this.memory!.buffer, at, 2 * length).slice();
  }

  private text(at: number, length: number): string {
    return new TextDecoder().decode(new Uint8Array(this.memory!.buffer, at, length));
  }

  /** Writes words where the module has room; returns their length. */
  private say(words: string, at: number, room: number): number {
    return new TextEncoder().encodeInto(words, new Uint8Array(this.memory!.buffer, at, room)).written;
  }
}

function release(held: Held): void {
  held.holders -= 1;
  if (held.holders === 0) held.buffer.destroy();
}
