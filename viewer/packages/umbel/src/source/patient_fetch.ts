// Fetches by HTTP: a request fails when nothing has arrived for a while, and failures are UmbelErrors.

import { memoryError, UmbelError } from "../errors.js";

/** Milliseconds without a byte after which a request fails. */
const PATIENCE = 15_000;

export interface FetchOptions {
  fetch?: typeof fetch;
  patience?: number;
}

/** Like `fetch`; the body fails, too, when it stops arriving. */
export async function patientFetch(
  url: string,
  init: { headers?: Record<string, string>; signal?: AbortSignal } = {},
  options: FetchOptions = {},
): Promise<Response> {
  const get = options.fetch ?? fetch;
  const aborter = new AbortController();
  const abort = () => aborter.abort();
  init.signal?.addEventListener("abort", abort);
  let timer: ReturnType<typeof setTimeout> | undefined;
  const wait = () => {
    clearTimeout(timer);
    timer = setTimeout(abort, options.patience ?? PATIENCE);
  };
  const end = () => {
    clearTimeout(timer);
    init.signal?.removeEventListener("abort", abort);
  };
  wait();
  try {
    const response = await get(url, { ...init, signal: aborter.signal });
    const watch = new TransformStream<Uint8Array, Uint8Array>({
      transform: (part, out) => {
        wait();
        out.enqueue(part);
      },
      flush: end,
    });
    if (!response.body) end();
    return new Response(response.body?.pipeThrough(watch) ?? null, response);
  } catch (error) {
    end();
    throw error;
  }
}

/** Reads a file as a whole, unless `signal` aborts that. */
export async function readWhole(url: string, signal: AbortSignal): Promise<Uint8Array> {
  try {
    const response = await patientFetch(url, { signal });
    if (!response.ok) throw statusError(response.status, url);
    return new Uint8Array(await response.arrayBuffer());
  } catch (error) {
    throw asUmbelError(error, url);
  }
}

/** The error of a request that failed. */
export function asUmbelError(error: unknown, url: string): UmbelError {
  if (error instanceof UmbelError) return error;
  const noMemory = memoryError(error);
  if (noMemory) return noMemory;
  // Browsers do not tell a page which of the two it is.
  const reason = isOther(url) ? ", or it does not let this page read the file (CORS)" : "";
  return new UmbelError("network", `The connection to ${hostOf(url)} was lost${reason}.`);
}

/** Whether an address is at another host than the page. */
function isOther(url: string): boolean {
  const own = globalThis.location?.origin;
  return own !== undefined && /^https?:/.test(url) && new URL(url).origin !== own;
}

/** The error of an answer's status. */
export function statusError(status: number, url: string): UmbelError {
  if (status >= 500 || status === 408 || status === 429)
    return new UmbelError("network", `${hostOf(url)} answered with an error (${status}).`);
  if (status === 404 || status === 410)
    return new UmbelError("missing", `There is no file at ${url}.`);
  const reason = status === 401 || status === 407 ? ": it asks for a login" : "";
  return new UmbelError("refused", `${hostOf(url)} refuses ${url} (${status})${reason}.`);
}

export function hostOf(url: string): string {
  try {
    return new URL(url).host || url;
  } catch {
    return url;
  }
}
