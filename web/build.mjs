// Builds the page that the program carries, into ../crates/selvedge-live/page.
import { build } from "esbuild";
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";

const out = "../crates/selvedge-live/page";

await build({
  entryPoints: ["src/main.ts"],
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "eof",
  define: { WITHOUT_PROGRAM: "false" },
  outfile: `${out}/viewer.js`,
});
// Shaders are text, and some of their lines end in spaces.
const script = readFileSync(`${out}/viewer.js`, "utf8");
writeFileSync(`${out}/viewer.js`, script.replace(/[ \t]+$/gm, ""));
copyFileSync("node_modules/three/LICENSE", `${out}/LICENSE-three.txt`);
await build({ entryPoints: ["src/viewer.css"], minify: true, outfile: `${out}/viewer.css` });
for (const name of ["index.html", "icon.svg"]) {
  copyFileSync(`src/${name}`, `${out}/${name}`);
}
