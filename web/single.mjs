// Pages that are one file each, with a scene, to be opened without a server: after build:static,
//   npm run build:single -- OUT SCENE...        writes OUT/SCENE.html
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";
import { transformSync } from "esbuild";

const [out = "dist-single", ...scenes] = process.argv.slice(2);
const from = process.env.PAGE ?? "dist";
const text = (name) => readFileSync(`${from}/${name}`, "utf8");
// A script in a page ends at the first of these, wherever that stands.
const inline = (script) => script.replaceAll("</script", "<\\/script");
const data = (type, bytes) => `data:${type};base64,${Buffer.from(bytes).toString("base64")}`;

// A page from a file may start no worker that is a module.
const worker = transformSync(text("worker.js"), { format: "iife", minify: true, define: { "import.meta.url": '""' } }).code;
const icon = data("image/svg+xml", text("icon.svg"));
const wasm = gzipSync(readFileSync(`${from}/selvedge.wasm`), { level: 9 }).toString("base64");
mkdirSync(out, { recursive: true });
for (const scene of scenes.length ? scenes : ["tablecloth"]) {
  const begin = `globalThis.selvedgeFile = {
  scene: ${JSON.stringify(scene)},
  worker: URL.createObjectURL(new Blob([${JSON.stringify(worker)}], { type: "text/javascript" })),
  wasm: Uint8Array.from(atob("${wasm}"), (letter) => letter.charCodeAt(0)),
};`;
  const page = text("index.html")
    .replaceAll('"icon.svg"', () => `"${icon}"`)
    .replace('<link rel="stylesheet" href="viewer.css">', () => `<style>${text("viewer.css")}</style>`)
    .replace('<script type="module" src="viewer.js"></script>', () =>
      `<script>${inline(begin)}</script>\n<script type="module">${inline(text("viewer.js"))}</script>`);
  writeFileSync(`${out}/${scene}.html`, page);
  console.log(`${(page.length / 1048576).toFixed(1)} MiB  ${out}/${scene}.html`);
}
