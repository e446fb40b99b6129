// Builds the page that the program carries, into ../crates/selvedge-live/page, and notes the hash
// of every source beside it, so that a test can say whether what is carried is what stands here.
import { build } from "esbuild";
import { copyFileSync, readFileSync, readdirSync, writeFileSync } from "node:fs";

const out = "../crates/selvedge-live/page";

/** FNV-1a, 64 bits: enough to notice a change. */
function hash(bytes) {
  let value = 0xcbf29ce484222325n;
  for (const byte of bytes) {
    value = BigInt.asUintN(64, (value ^ BigInt(byte)) * 0x100000001b3n);
  }
  return value.toString(16).padStart(16, "0");
}

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

const sources = readdirSync("src").map((name) => `src/${name}`);
sources.push("build.mjs", "package-lock.json", "package.json", "tsconfig.json");
sources.sort();
const lines = sources.map((name) => `${hash(readFileSync(name))}  ${name}\n`);
writeFileSync(`${out}/sources.txt`, lines.join(""));
