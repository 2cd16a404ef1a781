import { afterEach, describe, expect, test, vi } from "vitest";
import { UmbelError } from "../../../packages/umbel/src/errors.js";
import { HttpSource } from "../../../packages/umbel/src/source/http_source.js";

const BYTES = Uint8Array.from({ length: 1000 }, (_, i) => i % 251);
const URL = "https://host.test/a.umbel";

/** A host of BYTES; each request fails first as often as `failures` says. */
function host({ hasRanges = true, failures = 0, status = 0, isHidden = false } = {}) {
  const requests: string[] = [];
  const get = async (_: unknown, init?: RequestInit): Promise<Response> => {
    const range = new Headers(init?.headers).get("Range") ?? "";
    requests.push(range);
    if (failures-- > 0) throw new TypeError("no network");
    if (status) return new Response(null, { status });
    if (!hasRanges) return new Response(BYTES);
    const [first, last] = (range.match(/\d+/g) ?? []).map(Number) as [number, number];
    if (first >= BYTES.length) return new Response(null, { status: 416 });
    const part = BYTES.subarray(first, last + 1);
    const headers = { "Content-Range": `bytes ${first}-${last}/${BYTES.length}` };
    return new Response(part, { status: 206, headers: isHidden ? {} : headers });
  };
  return { requests, get: get as typeof fetch };
}

afterEach(() => {
  vi.unstubAllGlobals();
});

describe("an HTTP source", () => {
  test("reads ranges, and fewer bytes at the end of the file", async () => {
    const { requests, get } = host();
    const source = new HttpSource(URL, { fetch: get });
    expect(await source.read(10, 5)).toEqual(BYTES.slice(10, 15));
    expect(await source.read(990, 50)).toEqual(BYTES.slice(990));
    expect((await source.read(2000, 5)).length).toBe(0);
    expect(requests).toEqual(["bytes=10-14", "bytes=990-1039", "bytes=2000-2004"]);
    expect(source.fetched).toBe(15);
  });

  test("reads small files of other hosts, which hide the range of their answers", async () => {
    const { get } = host({ isHidden: true });
    const source = new HttpSource(URL, { fetch: get, delay: 1, retries: 0 });
    expect(await source.read(0, 5000)).toEqual(BYTES);
    expect(await source.read(990, 10)).toEqual(BYTES.slice(990));
    await expect(source.read(990, 20)).rejects.toThrow("sent less than was asked for");
  });

  test("downloads the file once from a host without ranges", async () => {
    const { requests, get } = host({ hasRanges: false });
    const source = new HttpSource(URL, { fetch: get });
    expect(await source.read(10, 5)).toEqual(BYTES.slice(10, 15));
    expect(await source.read(900, 500)).toEqual(BYTES.slice(900));
    expect(requests.length).toBe(1);
    expect(source.fetched).toBe(BYTES.length);
  });

  test("downloads the file from a host that compresses it whatever is asked for", async () => {
    const { requests, get } = host({ hasRanges: false });
    let breaks = 1;
    const compressing: typeof fetch = async (url, init) => {
      const response = await get(url, init);
      // As browsers do.
      if (requests.at(-1)) throw new TypeError("Failed to fetch");
      const half = new ReadableStream({
        start: (controller) => {
          controller.enqueue(BYTES.slice(0, 500));
          controller.error(new TypeError("no network"));
        },
      });
      const headers = { "Content-Encoding": "gzip", "Content-Length": "7" };
      return new Response(breaks-- > 0 ? half : response.body, { headers });
    };
    const source = new HttpSource(URL, { fetch: compressing, delay: 1 });
    expect(await source.read(10, 5)).toEqual(BYTES.slice(10, 15));
    expect(await source.read(900, 500)).toEqual(BYTES.slice(900));
    expect(requests).toEqual(["bytes=10-14", "", ""]);
  });

  test("asks for ranges again after a failure, if the host compresses only whole files", async () => {
    const { requests, get } = host();
    let failures = 0;
    const source = new HttpSource(URL, {
      fetch: async (url, init) => {
        const response = await get(url, init);
        if (failures-- > 0) throw new TypeError("no network");
        if (requests.at(-1)) return response;
        return new Response(BYTES, { headers: { "Content-Encoding": "gzip" } });
      },
      delay: 1,
    });
    await source.read(10, 5);
    failures = 1;
    expect(await source.read(900, 500)).toEqual(BYTES.slice(900));
    expect(requests).toEqual(["bytes=10-14", "bytes=900-1399", "bytes=900-1399"]);
    expect(source.fetched).toBe(105);
  });

  test("names the reason why a page may not read what another host has", async () => {
    const message = async (origin: string) => {
      vi.stubGlobal("location", { origin });
      const source = new HttpSource(URL, { fetch: host({ failures: 1 }).get, retries: 0 });
      return source.read(0, 3).catch((error: UmbelError) => error.message);
    };
    expect(await message("https://host.test")).toBe("The connection to host.test was lost.");
    expect(await message("https://page.test")).toContain("was lost, or it does not let this page");
  });

  test("tries again, and reports the connection", async () => {
    const states: boolean[] = [];
    const onConnection = (isLost: boolean) => states.push(isLost);
    const { get } = host({ failures: 2 });
    const source = new HttpSource(URL, { fetch: get, delay: 1, onConnection });
    expect(await source.read(0, 3)).toEqual(BYTES.slice(0, 3));
    expect(states).toEqual([true, false]);
  });

  test.each([
    ["says that the file is shorter", () => new Response(null, { status: 416 })],
    ["sends another file", () => new Response("<html>Who are you?</html>")],
  ])("tries again where a host %s for a while", async (_, answer) => {
    const { get } = host();
    let wrong = 0;
    const source = new HttpSource(URL, {
      fetch: async (url, init) => (wrong-- > 0 ? answer() : get(url, init)),
      delay: 1,
    });
    expect(await source.read(0, 5)).toEqual(BYTES.slice(0, 5));
    wrong = 2;
    expect(await source.read(500, 5)).toEqual(BYTES.slice(500, 505));
    expect(await source.read(990, 50)).toEqual(BYTES.slice(990));
  });

  test("reports a file that is gone as a lost connection, and that it is back", async () => {
    const states: boolean[] = [];
    const { get } = host();
    let isGone = true;
    const source = new HttpSource(URL, {
      fetch: (url, init) => (isGone ? host({ status: 404 }).get(url, init) : get(url, init)),
      onConnection: (isLost) => states.push(isLost),
    });
    await expect(source.read(0, 3)).rejects.toThrow("There is no file");
    isGone = false;
    await source.read(0, 3);
    expect(states).toEqual([true, false]);
  });

  test.each([
    ["an answer", () => new Promise<Response>(() => {})],
    ["the rest of an answer", async () => new Response(new ReadableStream(), { status: 206 })],
  ])("tries again where %s does not come", async (_, stall) => {
    const states: boolean[] = [];
    const { get } = host();
    let stalls = 2;
    const stalling = (async (url: string, init: RequestInit) => {
      if (stalls-- <= 0) return get(url, init);
      const aborted = new Promise<never>((_resolve, reject) => {
        init.signal?.addEventListener("abort", () => reject(new Error("aborted")));
      });
      const response = await Promise.race([stall(), aborted]);
      const body = new ReadableStream({
        start: (controller) => {
          aborted.catch((error: unknown) => controller.error(error));
        },
      });
      return new Response(body, response);
    }) as typeof fetch;
    const source = new HttpSource(URL, {
      fetch: stalling,
      delay: 1,
      patience: 20,
      onConnection: (isLost) => states.push(isLost),
    });
    expect(await source.read(0, 3)).toEqual(BYTES.slice(0, 3));
    expect(states).toEqual([true, false]);
  });

  test("says that a whole file finds no memory, where a host has no ranges", async () => {
    const states: boolean[] = [];
    const answer = new Response(BYTES, { headers: { "Content-Length": String(2 ** 40) } });
    vi.stubGlobal(
      "Uint8Array",
      new Proxy(Uint8Array, {
        construct: (type, [size, ...rest]) => {
          if (size === 2 ** 31) throw new RangeError("Array buffer allocation failed");
          return Reflect.construct(type, [size, ...rest]);
        },
      }),
    );
    const source = new HttpSource(URL, {
      fetch: async () => answer,
      onConnection: (isLost) => states.push(isLost),
    });
    await expect(source.read(0, 3)).rejects.toMatchObject({
      kind: "memory",
      message: expect.stringContaining("no HTTP ranges"),
    });
    expect(states).toEqual([]);
  });

  test.each([
    [404, "missing", 1],
    [401, "refused", 1],
    [403, "refused", 1],
    [503, "network", 3],
  ])("status %i is an error of kind %s", async (status, kind, count) => {
    const { requests, get } = host({ status });
    const source = new HttpSource(URL, { fetch: get, delay: 1, retries: 2 });
    const error = await source.read(0, 3).catch((caught: unknown) => caught);
    expect(error).toBeInstanceOf(UmbelError);
    expect((error as UmbelError).kind).toBe(kind);
    expect(requests.length).toBe(count);
  });
});
