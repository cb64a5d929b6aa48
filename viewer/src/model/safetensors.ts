// Whole numbers out of a safetensors file: a length, a JSON header, and the bytes of the arrays.

interface Entry {
  dtype: string;
  data_offsets: [number, number];
}

/** The numbers of an array of uint32; none where the file has no such array. */
export function indices(bytes: Uint8Array<ArrayBuffer>, name: string): Uint32Array {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const start = 8 + Number(view.getBigUint64(0, true));
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(8, start))) as Record<string, Entry | undefined>;
  const entry = header[name];
  if (entry?.dtype !== "U32") return new Uint32Array(0);
  const [from, to] = entry.data_offsets;
  return Uint32Array.from({ length: (to - from) / 4 }, (_, k) => view.getUint32(start + from + 4 * k, true));
}
