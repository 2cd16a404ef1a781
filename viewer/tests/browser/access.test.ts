import { expect, quiet, settled, test } from "./page.js";

const COARSE = "/?asset=planet.umbel#pixels=6";

test("controls say their names and values", async ({ page, host }) => {
  await page.goto(host.url + COARSE);
  await settled(page);
  const error = page.getByRole("slider", { name: "Allowed error in pixels" });
  await expect(error).toHaveAttribute("aria-valuetext", "6.0 px");
  await error.focus();
  await page.keyboard.press("End");
  await expect(error).toHaveAttribute("aria-valuetext", "64 px");
  const memory = page.getByRole("slider", { name: "Memory for geometry and textures" });
  await expect(memory).toHaveAttribute("aria-valuetext", "537 MB");
  const modes = page.getByRole("group", { name: "View mode" });
  await expect(modes.getByRole("button", { pressed: true })).toHaveText("Shaded");
  await expect(page.getByRole("group", { name: "Comparison" })).toBeVisible();
  await expect(page.getByRole("img", { name: /^\d+ of \d+ pages are in memory/ })).toBeVisible();
});

test("the map of pages has a name before there are any", async ({ page, host }) => {
  await page.goto(host.url);
  await expect(page.getByRole("img", { name: "No pages yet." })).toBeAttached();
});

test("cards that are higher than the page scroll", async ({ page, host }) => {
  await page.setViewportSize({ width: 320, height: 200 });
  await page.goto(host.url + COARSE);
  await settled(page);
  await page.mouse.click(160, 100);
  const isInside = (selector: string) =>
    page.locator(selector).evaluate((element) => {
      element.scrollIntoView({ block: "nearest" });
      const card = element.closest("#picked, .error-card") as Element;
      return [element, card].every((each) => {
        const { top, bottom } = each.getBoundingClientRect();
        return top >= 0 && bottom <= innerHeight;
      });
    });
  await expect(page.locator("#picked")).toBeVisible();
  expect(await isInside("#picked dd:last-child")).toBe(true);
  expect(await isInside("#picked button")).toBe(true);
  await page.goto("about:blank");
  await page.goto(`${host.url}/?asset=${"missing_".repeat(30)}.umbel`);
  await expect(page.getByRole("alert")).toContainText("Not found");
  expect(await isInside(".error-card h1")).toBe(true);
  expect(await isInside(".error-card button:last-child")).toBe(true);
});

test("forced colours show what is chosen", async ({ page, host }) => {
  await page.emulateMedia({ forcedColors: "active" });
  await page.goto(`${host.url}${COARSE}&layout=wipe`);
  await settled(page);
  await quiet(page);
  const background = (selector: string, pseudo?: string) =>
    page
      .locator(selector)
      .first()
      .evaluate((element, of) => getComputedStyle(element, of).backgroundColor, pseudo);
  const chosen = await background("[data-mode=shaded]");
  expect(chosen).not.toBe(await background("[data-mode=levels]"));
  expect(await background(".divider", "::before")).toBe(chosen);
});

test("the picture shows that it has the focus, over its background too", async ({ page, host }) => {
  for (const forcedColors of ["none", "active"] as const) {
    await page.emulateMedia({ forcedColors });
    await page.goto("about:blank");
    // Glass needs a background in the picture.
    await page.goto(`${host.url}/?asset=materials.umbel#pixels=32`);
    await settled(page);
    await page.keyboard.press("Tab");
    await expect(page.locator(".viewport canvas")).toBeFocused();
    const outline = await page.locator(".viewport canvas").evaluate((canvas) => {
      const { outlineStyle, outlineWidth, outlineOffset } = getComputedStyle(canvas);
      return `${outlineStyle} ${outlineWidth} ${outlineOffset}`;
    });
    expect(outline).toBe("solid 2px -2px");
    const { x, y } = (await page.locator(".viewport canvas").boundingBox()) as {
      x: number;
      y: number;
    };
    await page.keyboard.press("Escape");
    const edge = { x, y: y + 100, width: 2, height: 40 };
    const focused = await page.screenshot({ clip: edge });
    await page.locator("#share").focus();
    expect(focused.equals(await page.screenshot({ clip: edge }))).toBe(false);
  }
});
