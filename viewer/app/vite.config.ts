import { fileURLToPath } from "node:url";
import { defineConfig } from "vite";

export default defineConfig({
  root: fileURLToPath(new URL(".", import.meta.url)),
  // Relative paths: the page works in any folder of a server.
  base: "./",
  build: {
    outDir: process.env.UMBEL_PAGE ?? "../dist",
    emptyOutDir: true,
    chunkSizeWarningLimit: 1000,
    assetsInlineLimit: 0,
  },
  worker: { format: "es" },
});
