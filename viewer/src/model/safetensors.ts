// Whole numbers out of a safetensors file: a length, a JSON header, and the bytes of the arrays.

interface Entry {
  dtype: string;
  data_offsets: [number, number];
}

/** The notes of a case for the page alone (python/viscera/viewer/live.py); none where the file has none, or is damaged. */
export function notesOf(bytes: Uint8Array<ArrayBuffer>): object {
  try {
    const notes = headerOf(bytes)["__metadata__"] as { page?: string } | undefined;
    return JSON.parse(notes?.page ?? "{}") as object;
  } catch {
    // Whoever steps the case says what is the matter with it.
    return {};
  }
}

/** The numbers of an array of uint32; none where the file has no such array. */
export function indices(bytes: Uint8Array<ArrayBuffer>, name: string): Uint32Array {
  const view = viewOf(bytes);
  const start = startOf(view);
  const entry = headerOf(bytes)[name] as Entry | undefined;
  if (entry?.dtype !== "U32") return new Uint32Array(0);
  const [from, to] = entry.data_offsets;
  return Uint32Array.from({ length: (to - from) / 4 }, (_, k) => view.getUint32(start + from + 4 * k, true));
}

function headerOf(bytes: Uint8Array<ArrayBuffer>): Record<string, unknown> {
  return JSON.parse(new TextDecoder().decode(bytes.subarray(8, startOf(viewOf(bytes))))) as Record<string, unknown>;
}

function viewOf(bytes: Uint8Array<ArrayBuffer>): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** Where the arrays begin. */
function startOf(view: DataView): number {
  return 8 + Number(view.getBigUint64(0, true));
}
