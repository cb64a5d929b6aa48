// One module with everything in it (three.js, the evaluator, the style): the page and the notebook load the same file.
// Beside it the worker that steps a case, which shares no code with it.
import { defineConfig } from "vite";

export default defineConfig({
  publicDir: "public",
  build: {
    target: "es2022",
    outDir: "../python/viscera/viewer/static",
    emptyOutDir: true,
    assetsInlineLimit: Number.MAX_SAFE_INTEGER,
    lib: { entry: { viewer: "src/index.ts", stepper: "src/live/stepper.ts" }, formats: ["es"], fileName: (_, name) => `${name}.js` },
  },
});
