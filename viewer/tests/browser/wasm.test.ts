import { expect, measureCanvas, settled, test } from "./page.js";

/** Pictures as addresses, which the test itself looks at. */
const POLICY = "default-src 'self'; connect-src 'self' data:";

for (const [what, policy] of [
  ["by WebAssembly without a policy", undefined],
  ["by WebAssembly where a policy allows it", `${POLICY}; script-src 'self' 'wasm-unsafe-eval'`],
  ["in TypeScript where none does", POLICY],
] as const)
  test(`pages are decoded ${what}`, async ({ page, host }) => {
    host.policy = policy;
    const module = page.waitForResponse(/decoder-[^/]*\.wasm/);
    await page.goto(`${host.url}/?asset=paged.umbel#pixels=0.1`);
    expect((await module).ok()).toBe(true);
    await settled(page);
    expect((await measureCanvas(page)).covered).toBeGreaterThan(0.1);
  });
