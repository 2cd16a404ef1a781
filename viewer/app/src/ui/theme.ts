// The dark or light theme: the system's until the user chooses.

const KEY = "umbel-theme";

/** The stored choice; null without one, or where the browser stores nothing for this page. */
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
    // Without storage the choice lasts as long as the page.
  }
}
