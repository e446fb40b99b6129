// Measures what docs/src/benchmarks.md says: node tests/measure-static.mjs [steps|memory]
// Needs npm run build:static, the release build (or SELVEDGE=PATH), and Debian's Chromium.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { browser, open, program } from "./browser.mjs";
import { serve } from "./server.mjs";

const what = process.argv.slice(2);
const wanted = (name) => what.length === 0 || what.includes(name);
const folder = mkdtempSync(join(tmpdir(), "selvedge-measure-"));

/** Milliseconds per frame of the program with one thread, the least of five runs. */
function native(scene, frames, model) {
  const times = Array.from({ length: 5 }, () => {
    const out = join(folder, "out");
    rmSync(out, { recursive: true, force: true });
    const args = model ? ["--model", model, "-o", out] : ["-o", `${out}.safetensors`];
    rmSync(`${out}.safetensors`, { force: true });
    const told = execFileSync(program, ["run", scene, "--frames", String(frames), ...args, "--json"], {
      env: { ...process.env, RAYON_NUM_THREADS: "1" },
      stdio: ["ignore", "pipe", "ignore"],
    });
    const answer = JSON.parse(told.toString());
    return answer.ms_per_frame ?? answer.model_ms_per_frame;
  });
  return Math.min(...times);
}

/** The same in the browser. */
function inPage(page, scene, frames, model) {
  return page.evaluate(
    async ([scene, frames, model]) => {
      const { Cloth } = await import("/index.js");
      const cloth = await Cloth.load(scene, { model });
      let least = Infinity;
      for (let run = 0; run < 5; run++) {
        cloth.reset();
        const began = performance.now();
        for (let frame = 0; frame < frames; frame++) cloth.step();
        least = Math.min(least, (performance.now() - began) / frames);
      }
      cloth.free();
      return least;
    },
    [scene, frames, model],
  );
}

async function steps() {
  const served = await serve("dist-npm");
  const { context, close } = await browser({ width: 320, height: 240 });
  const page = await context.newPage();
  // Any text of this server: the module is all that is wanted.
  await page.goto(`${served.url}index.js`);
  for (const [scene, frames, model] of [["default", 300], ["square-1024", 100], ["tablecloth", 100], ["default", 60, "paper"]]) {
    const here = await inPage(page, scene, frames, model);
    const there = native(scene, frames, model);
    console.log(scene, model ?? "solver", { page_ms: here, steps_per_second: 1000 / here, program_ms: there, share: there / here });
  }
  await close();
  await served.stop();
}

/** Memory of all processes of the browser, MB, each minute of ten, while a cloth is led about. */
async function memory() {
  const served = await serve("dist");
  const { context, close } = await browser({ width: 640, height: 480 });
  const page = await open(context, `${served.url}?scene=default`);
  await page.evaluate(() => {
    const { stage } = window.selvedge;
    const [goal] = stage.frame.goals;
    const { x, y, z } = goal;
    let k = 0;
    setInterval(() => {
      k += 0.1;
      window.selvedge.drag([{ vertex: goal.vertex, x: x + 0.2 * Math.sin(k), y, z: z + 0.1 * Math.cos(k) - 0.1 }]);
    }, 50);
  });
  const resident = () => {
    const all = execFileSync("ps", ["-eo", "rss,args"]).toString().split("\n");
    const sizes = all.filter((line) => line.includes("selvedge-browser-")).map((line) => parseInt(line, 10));
    return Math.round(sizes.reduce((sum, size) => sum + size, 0) / 1024);
  };
  for (let minute = 0; minute <= 10; minute++) {
    const { time } = await page.evaluate(() => window.selvedge.stage.frame);
    console.log(`minute ${minute}: ${resident()} MB, ${time.toFixed(0)} s of cloth`);
    if (minute < 10) await page.waitForTimeout(60_000);
  }
  await close();
  await served.stop();
}

if (wanted("steps")) await steps();
if (wanted("memory")) await memory();
rmSync(folder, { recursive: true });
