// One module with everything in it (three.js, the evaluator, the style): the page and the notebook load the same file.
import { defineConfig } from "vite";

export default defineConfig({
  publicDir: "public",
  build: {
    target: "es2022",
    outDir: "../python/viscera/viewer/static",
    emptyOutDir: true,
    assetsInlineLimit: Number.MAX_SAFE_INTEGER,
    lib: { entry: "src/index.ts", formats: ["es"], fileName: () => "viewer.js" },
  },
});
