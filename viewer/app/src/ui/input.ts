// What hands do: clicks, drops and keys.

/** A click that moves farther than this, in pixels, is a drag. */
const CLICK = 5;

/** Tells of clicks on the picture, and when a hand begins to move it. */
export function listenToPointer(
  host: HTMLElement,
  tell: { down(): void; click(x: number, y: number): void },
): void {
  let start: [number, number] | undefined;
  host.addEventListener("pointerdown", (event) => {
    start = event.button === 0 ? [event.clientX, event.clientY] : undefined;
    tell.down();
  });
  host.addEventListener("pointerup", (event) => {
    if (!start) return;
    const moved = Math.hypot(event.clientX - start[0], event.clientY - start[1]);
    if (moved < CLICK) tell.click(event.clientX, event.clientY);
    start = undefined;
  });
}

/** Tells of files that are dropped anywhere on the page, and where; `hint` is shown before. */
export function listenToDrops(hint: HTMLElement, drop: (file: File, x: number) => void): void {
  addEventListener("dragover", (event) => {
    event.preventDefault();
    hint.hidden = false;
  });
  addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) hint.hidden = true;
  });
  addEventListener("drop", (event) => {
    event.preventDefault();
    hint.hidden = true;
    const file = event.dataTransfer?.files[0];
    if (file) drop(file, event.clientX);
  });
}

/** Calls `press` with keys that nothing else on the page takes; it says whether it knows one. */
export function listenToKeys(press: (key: string) => boolean): void {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof HTMLInputElement && event.target.type === "range") return;
    if (press(event.key.length === 1 ? event.key.toLowerCase() : event.key)) event.preventDefault();
  });
}
