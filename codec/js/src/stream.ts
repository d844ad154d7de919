/** Files from streams, what not every file needs fetched when one does. */
import { Decoder, type DecoderOptions, type IsoEvent } from "./decoder.js";

export interface StreamOptions extends DecoderOptions {
  /** Fetches `main.bin`; by default from beside this module. Asked for once, when a file needs it. */
  loadTables?: () => Promise<Uint8Array>;
}

const fetched = new Map<string, Promise<Uint8Array>>();

/** The tables of the main profile, from beside this module; they are fetched once. */
export function fetchTables(url: string | URL = new URL("./main.bin", import.meta.url)): Promise<Uint8Array> {
  const key = String(url), known = fetched.get(key);
  if (known) return known;
  const tables = fetch(url).then(async (answer) => {
    if (!answer.ok) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
    return new Uint8Array(await answer.arrayBuffer());
  });
  fetched.set(key, tables);
  tables.catch(() => fetched.delete(key));
  return tables;
}

/** Load what a decoder waits for, if it waits for something: the main profile with the tables of `load`, or domains. */
export async function supply(decoder: Decoder, load: () => Promise<Uint8Array> = fetchTables): Promise<IsoEvent[]> {
  if (decoder.error) return [];
  if (decoder.needs === "main") {
    const [{ MainProfile }, bytes] = await Promise.all([import("./main/profile.js"), load()]);
    return decoder.setMain(new MainProfile(bytes));
  }
  return decoder.needs ? decoder.setDomains(await import("./domain/contents.js")) : [];
}

/**
 * Decode a stream of bytes. Yields the decoder with what has happened since the last time: after each piece that came,
 * and at the end. Draw from it whenever there is time; an error of the file is the last event.
 */
export async function* decodeStream(stream: ReadableStream<Uint8Array>, options: StreamOptions = {}):
AsyncGenerator<{ decoder: Decoder; events: IsoEvent[] }, Decoder, void> {
  const decoder = new Decoder(options), reader = stream.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      const events = done ? decoder.end() : decoder.feed(value);
      events.push(...(await supply(decoder, options.loadTables)));
      yield { decoder, events };
      if (done || decoder.error) return decoder;
    }
  } finally {
    reader.cancel().catch(() => undefined);
  }
}
