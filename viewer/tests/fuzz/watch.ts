// Counts the memory of typed arrays that an action allocates.

const KINDS = [
  ...(["Uint8Array", "Int16Array", "Uint16Array", "Int32Array", "Uint32Array"] as const),
  ...(["Float32Array", "Float64Array"] as const),
];

/** Bytes of all typed arrays that an action makes, views of existing buffers excluded. */
export function allocated(action: () => void): number {
  const before = new Map<string, unknown>();
  const globals = globalThis as unknown as Record<string, unknown>;
  let bytes = 0;
  const count = <T>(array: T): T => {
    bytes += (array as unknown as Uint8Array).byteLength;
    return array;
  };
  for (const kind of KINDS) {
    const plain = globals[kind] as Uint8ArrayConstructor;
    before.set(kind, plain);
    globals[kind] = new Proxy(plain, {
      construct(target, given) {
        const array = Reflect.construct(target, given);
        // A view of a buffer that is there takes none.
        return given[0] instanceof ArrayBuffer ? array : count(array);
      },
      get: (target, name) =>
        name === "from"
          ? (...given: Parameters<typeof plain.from>) => count(target.from(...given))
          : Reflect.get(target, name),
    });
  }
  try {
    action();
  } finally {
    for (const [kind, plain] of before) globals[kind] = plain;
  }
  return bytes;
}
