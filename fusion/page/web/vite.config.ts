import { defineConfig } from "vite";

// The binary embeds dist/ as it is; names carry a hash so that browsers may keep files for ever.
export default defineConfig({
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    target: "es2022",
    assetsInlineLimit: 0, // the server's content policy allows files, not data: addresses
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
    chunkSizeWarningLimit: 900, // three.js, loaded after the first view
  },
  server: { proxy: { "/api": { target: "http://127.0.0.1:8787", ws: true } } },
});
