// Input: clicks, dropped files and keys.

/** Pixels of movement from which a click is a drag. */
const CLICK_DISTANCE = 5;

/** Reports clicks on the viewport, and each press of a pointer. */
export function listenToPointer(
  host: HTMLElement,
  listener: { down(): void; click(x: number, y: number): void },
): void {
  let start: [number, number] | undefined;
  host.addEventListener("pointerdown", (event) => {
    // A second finger makes a gesture of the first.
    const isClick = event.isPrimary && event.button === 0;
    start = isClick ? [event.clientX, event.clientY] : undefined;
    listener.down();
  });
  host.addEventListener("pointercancel", () => {
    start = undefined;
  });
  host.addEventListener("pointerup", (event) => {
    if (!start) return;
    const moved = Math.hypot(event.clientX - start[0], event.clientY - start[1]);
    if (moved < CLICK_DISTANCE) listener.click(event.clientX, event.clientY);
    start = undefined;
  });
}

/**
 * Reports the first of the files dropped on the page, with the position and their number; shows `hint`
 * while a file is dragged.
 */
export function listenToDrops(
  hint: HTMLElement,
  drop: (file: File, x: number, count: number) => void,
): void {
  addEventListener("dragover", (event) => {
    event.preventDefault();
    const hasFiles = event.dataTransfer?.types.includes("Files") ?? false;
    if (event.dataTransfer && !hasFiles) event.dataTransfer.dropEffect = "none";
    hint.hidden = !hasFiles;
  });
  addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) hint.hidden = true;
  });
  addEventListener("drop", (event) => {
    event.preventDefault();
    hint.hidden = true;
    const files = event.dataTransfer?.files;
    if (files?.[0]) drop(files[0], event.clientX, files.length);
  });
}

/**
 * Reports keys that no control of the page uses, and whether they repeat because they are held;
 * `press` returns whether it knows the key.
 */
export function listenToKeys(press: (key: string, isRepeated: boolean) => boolean): void {
  addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof HTMLInputElement && event.target.type === "range") return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (press(key, event.repeat)) event.preventDefault();
  });
}
