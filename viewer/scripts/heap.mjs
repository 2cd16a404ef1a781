// The memory of a page's JavaScript and of its workers', by Chromium's protocol for developers.

/** Returns a function that measures; `collect` frees garbage first. */
export async function heapMeter(page) {
  const session = await page.context().newCDPSession(page);
  const workers = new Map();
  const waiting = new Map();
  let id = 0;
  session.on("Target.attachedToTarget", ({ sessionId, targetInfo }) => {
    if (targetInfo.type === "worker") workers.set(sessionId, targetInfo.url);
  });
  session.on("Target.detachedFromTarget", ({ sessionId }) => workers.delete(sessionId));
  session.on("Target.receivedMessageFromTarget", ({ message }) => {
    const { id, result } = JSON.parse(message);
    waiting.get(id)?.(result);
    waiting.delete(id);
  });
  await session.send("Target.setAutoAttach", {
    autoAttach: true,
    waitForDebuggerOnStart: false,
    flatten: false,
  });
  const ask = (sessionId, method) =>
    new Promise((answer) => {
      waiting.set(++id, answer);
      const message = JSON.stringify({ id, method });
      void session.send("Target.sendMessageToTarget", { sessionId, message });
    });
  const total = ({ usedSize, backingStorageSize }) => usedSize + (backingStorageSize ?? 0);
  return async (collect) => {
    if (collect) await session.send("HeapProfiler.collectGarbage");
    const heap = total(await session.send("Runtime.getHeapUsage"));
    let inWorkers = 0;
    for (const worker of workers.keys()) {
      if (collect) await ask(worker, "HeapProfiler.collectGarbage");
      inWorkers += total(await ask(worker, "Runtime.getHeapUsage"));
    }
    return { page: heap, workers: inWorkers };
  };
}
