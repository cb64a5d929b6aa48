// The parts of a page: files beside it, or embedded in it as base64 where it is one file (viscera/viewer/page.py).
import { bytesOf } from "./base64";
import { requireRoom, withinMemory } from "./memory";

/** The bytes of a part that is embedded in the page; null where it is a file of its own. */
export function embedded(name: string): Uint8Array<ArrayBuffer> | null {
  const text = document.getElementById(name)?.textContent;
  return text ? bytesOf(text) : null;
}

/** Where a script is to be loaded from. */
export function address(script: string): string | URL {
  const content = embedded(script);
  return content ? URL.createObjectURL(new Blob([content], { type: "text/javascript" })) : script;
}

/** Says of a file, by its address, that it did not come, and what to do. */
export function absent(url: string): string {
  return `${url} did not arrive; see that its server runs and is not blocked, then reload this page`;
}

/** The bytes of a part, saying how much of them is there [%]. */
export async function load(url: string, say: (percent: number) => void): Promise<Uint8Array<ArrayBuffer>> {
  const content = embedded(url);
  if (content) return content;
  const response = await arriving(url, fetch(url));
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  const total = Number(response.headers.get("content-length"));
  requireRoom(total);
  const reader = response.body?.getReader();
  if (!reader) return new Uint8Array(await response.arrayBuffer());
  const chunks: Uint8Array[] = [];
  let length = 0;
  const next = () => arriving(url, reader.read());
  for (let part = await next(); !part.done; part = await next()) {
    chunks.push(part.value);
    length += part.value.length;
    // A server that compresses on its way does not know how much there is.
    if (total) say(Math.min(100, Math.round((100 * length) / total)));
  }
  const all = withinMemory(length, () => new Uint8Array(length));
  chunks.reduce((at, chunk) => (all.set(chunk, at), at + chunk.length), 0);
  return all;
}

/** What the browser answers; where the network fails, a sentence in place of the browser's own words. */
async function arriving<T>(url: string, answer: Promise<T>): Promise<T> {
  try {
    return await answer;
  } catch (error) {
    throw new Error(absent(url), { cause: error });
  }
}
