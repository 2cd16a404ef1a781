// Dark or light: as the system has it, until someone chooses.

const KEY = "umbel-theme";

/** What was chosen before; nothing where the browser keeps nothing for this page. */
function chosenTheme(): string | null {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null;
  }
}

export function applyTheme(chosen = chosenTheme()): void {
  const preferred = matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  document.documentElement.dataset.theme =
    chosen === "light" || chosen === "dark" ? chosen : preferred;
}

export function toggleTheme(): void {
  const other = document.documentElement.dataset.theme === "light" ? "dark" : "light";
  applyTheme(other);
  try {
    localStorage.setItem(KEY, other);
  } catch {
    // It holds until the page is left.
  }
}
