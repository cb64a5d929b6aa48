// Models that a page cannot hold: said before they are fetched, or where the browser's memory ends.

/** WebAssembly has 4 GiB at the most, and while it is read a model is there twice [bytes]. */
const LARGEST = 2 ** 31;

/** Refuses a file that is too large in any browser. */
export function requireRoom(bytes: number): void {
  if (bytes > LARGEST) throw tooLarge(bytes);
}

/** What `read` returns; its failure for want of memory as a sentence. */
export function withinMemory<T>(bytes: number, read: () => T): T {
  try {
    return read();
  } catch (error) {
    // An allocation that fails ends the module; and the browser's own arrays are refused as out of range.
    throw error instanceof WebAssembly.RuntimeError || error instanceof RangeError ? tooLarge(bytes) : error;
  }
}

function tooLarge(bytes: number): Error {
  const size = bytes >= 1e9 ? `${(bytes / 1e9).toFixed(1)} GB` : `${(bytes / 1e6).toFixed(1)} MB`;
  return new Error(
    `the model takes ${size}, more memory than this browser gives a page; viscera view --export writes a version below 25 MB.`,
  );
}
