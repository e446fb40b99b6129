// Builds what runs without a program, as WebAssembly: the page, whose session runs in a worker, into
// dist/ or the folder that is named, for any web server; and the npm package, into dist-npm/.
import { build } from "esbuild";
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { gzipSync } from "node:zlib";

const out = process.argv[2] ?? "dist";
const target = process.env.CARGO_TARGET_DIR ?? "wasm/target";
const module = `${target}/wasm32-unknown-unknown/release/selvedge_web.wasm`;

/** Runs a tool of the build; where that is missing, says how to get it. */
function run(tool, args, remedy, cwd = ".") {
  try {
    execFileSync(tool, args, { stdio: "inherit", cwd });
  } catch (error) {
    console.error(`${tool}: ${error.code === "ENOENT" ? "is not installed" : "failed"}. ${remedy}`);
    process.exit(1);
  }
}

run("cargo", ["build", "--release", "--locked"], "Once: rustup target add wasm32-unknown-unknown", "wasm");
// In this folder, whose build is for this machine.
const bindgen = ["run", "--quiet", "--locked", "--manifest-path", "wasm/Cargo.toml", "-p", "selvedge-bindgen"];
run("cargo", [...bindgen, "--", module, "wasm/pkg"], "It is in wasm/bindgen");
run("node_modules/.bin/tsc", ["-p", "."], "Once: npm ci");
run("node_modules/.bin/tsc", ["-p", "wasm"], "Once: npm ci");

const common = { bundle: true, minify: true, format: "esm", target: "es2022", legalComments: "eof" };
mkdirSync(out, { recursive: true });
await build({ ...common, entryPoints: ["src/main.ts"], outfile: `${out}/viewer.js`, define: { WITHOUT_PROGRAM: "true" } });
await build({ ...common, entryPoints: ["wasm/worker.ts"], outfile: `${out}/worker.js` });
await build({ entryPoints: ["src/viewer.css"], minify: true, outfile: `${out}/viewer.css` });
for (const name of ["index.html", "icon.svg"]) copyFileSync(`src/${name}`, `${out}/${name}`);
copyFileSync("node_modules/three/LICENSE", `${out}/LICENSE-three.txt`);
copyFileSync("wasm/pkg/selvedge_web_bg.wasm", `${out}/selvedge.wasm`);

// The package: the module, and index.ts around it.
rmSync("dist-npm", { recursive: true, force: true });
mkdirSync("dist-npm");
for (const name of ["package.json", "README.md", "index.ts"]) copyFileSync(`npm/${name}`, `dist-npm/${name}`);
for (const name of readdirSync("wasm/pkg")) copyFileSync(`wasm/pkg/${name}`, `dist-npm/${name}`);
const types = ["--declaration", "--strict", "--target", "es2022", "--module", "esnext", "--moduleResolution", "bundler", "--types", "", "--skipLibCheck"];
run("node_modules/.bin/tsc", [...types, "--lib", "es2022,dom", "--ignoreConfig", "dist-npm/index.ts"], "Once: npm ci");
rmSync("dist-npm/index.ts");
// Examples, with what they load.
mkdirSync("dist-npm/examples");
for (const name of ["example.js", "cape.js", "cape.toml"]) copyFileSync(`npm/${name}`, `dist-npm/examples/${name}`);
copyFileSync("../assets/bodies/mannequin.glb", "dist-npm/examples/mannequin.glb");

let sum = 0;
for (const name of readdirSync(out)) {
  const bytes = gzipSync(readFileSync(`${out}/${name}`)).length;
  sum += bytes;
  console.log(`${(bytes / 1024).toFixed(0).padStart(6)} KiB gzipped  ${out}/${name}`);
}
console.log(`${(sum / 1024).toFixed(0).padStart(6)} KiB in all`);
