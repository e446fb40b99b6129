// Measures what docs/src/benchmarks.md says of the live viewer:
// node tests/measure.mjs [start|drag|playback|page]
// Needs the release build (or SELVEDGE=PATH), for `page` npm run build:static, and Debian's Chromium; draws with
// software GL.
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { browser, open, place, program, start, until } from "./browser.mjs";
import { writeRecording } from "./recording.mjs";
import { serve } from "./server.mjs";

const what = process.argv.slice(2);
const wanted = (name) => what.length === 0 || what.includes(name);
const median = (numbers) => numbers.toSorted((a, b) => a - b)[Math.floor(numbers.length / 2)];
const small = { width: 640, height: 480 };

/** From the start of the program to a cloth's first frame in a browser that is open already. */
async function startTime() {
  const { context, close } = await browser(small);
  const times = [];
  for (let k = 0; k < 5; k++) {
    const served = await start(["--show", "model"]);
    const page = await open(context, served.url);
    const number = await page.evaluate(() => window.selvedge.stage.frame.number);
    await until(page, (n) => window.selvedge.stage.frame.number > n, number);
    times.push((performance.now() - served.began) / 1000);
    await page.close();
    await served.stop();
  }
  await close();
  return { runs: times.length, median_s: median(times), most_s: Math.max(...times) };
}

/** Frames per second of the session, and of the page, over `seconds`. */
async function pace(page, seconds) {
  const read = () =>
    page.evaluate(() => ({ number: window.selvedge.stage.frame.number, at: performance.now(), fps: window.selvedge.meters.fps }));
  const before = await read();
  await page.waitForTimeout(1000 * seconds);
  const after = await read();
  return { steps_per_second: (1000 * (after.number - before.number)) / (after.at - before.at), drawn_per_second: after.fps };
}

/** Steps of each second by the session's own clock, where they change, over `seconds`: at this page a frame arrives late that is drawn late. */
const eachSecond = (page, seconds) =>
  page.evaluate(async (seconds) => {
    const [began, found] = [performance.now(), []];
    for (let last; performance.now() - began < 1000 * seconds; await new Promise((done) => setTimeout(done, 30))) {
      const { kept, frame_rate } = window.selvedge.state;
      if (kept !== last) found.push((kept * frame_rate).toFixed(1));
      last = kept;
    }
    return found.join(" ");
  }, seconds);

/** Leaves the drawing out: software GL takes the processor that a graphics card would spare. */
const withoutDrawing = (page) => page.evaluate(() => (window.selvedge.stage.renderer.render = () => {}));

/** Drags a handle in circles for `seconds`: from a pointer's move to the picture after it. */
async function circles(page, vertex, seconds) {
  const from = await place(page, vertex);
  await page.evaluate(() => (window.selvedge.meters.latencies.length = 0));
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  const kept = pace(page, seconds);
  const began = performance.now();
  for (let k = 0; performance.now() - began < 1000 * seconds; k++) {
    await page.mouse.move(from.x + 40 * Math.sin(k / 10), from.y - 30 + 30 * Math.cos(k / 10));
    await page.waitForTimeout(16);
  }
  await page.mouse.up();
  const latencies = await page.evaluate(() => window.selvedge.meters.latencies);
  return { drags: latencies.length, median_ms: median(latencies), ...(await kept) };
}

/** The shipped model on 400 vertices under a hand. */
async function dragTime() {
  const { context, close } = await browser(small);
  const served = await start(["--show", "model"]);
  const page = await open(context, served.url);
  // So small a page hides the panel.
  await page.click("#settings");
  await page.selectOption("#mesh", "square");
  await page.selectOption("#vertices", "400");
  await until(page, () => window.selvedge.state.order.mesh?.vertices === 400 && !window.selvedge.state.busy);
  await page.click("#settings");
  await page.waitForTimeout(2000);
  const vertex = await page.evaluate(() => window.selvedge.stage.frame.goals[0].vertex);
  const drawn = await circles(page, vertex, 10);
  await withoutDrawing(page);
  await page.keyboard.press("Home");
  await page.waitForTimeout(1000);
  const undrawn = await circles(page, vertex, 10);
  const step_ms = await page.evaluate(() => window.selvedge.state.tracks[0].step_ms);
  const vertices = await page.evaluate(() => window.selvedge.stage.frame.tracks[0].length / 3);
  await close();
  await served.stop();
  return { vertices, step_ms, drawn, undrawn };
}

/** A recording of 10,000 vertices over the socket. */
async function playback() {
  const folder = mkdtempSync(join(tmpdir(), "selvedge-recording-"));
  const file = join(folder, "wave.safetensors");
  writeRecording(file, 100, 240);
  const served = await start([file]);
  const { context, close } = await browser(small);
  const page = await open(context, served.url);
  await page.waitForTimeout(2000);
  const vertices = await page.evaluate(() => window.selvedge.stage.frame.tracks[0].length / 3);
  const drawn = { ...(await pace(page, 8)), taken_up: await taken(page, 5) };
  await withoutDrawing(page);
  const undrawn = { ...(await pace(page, 8)), taken_up: await taken(page, 5) };
  await close();
  await served.stop();
  rmSync(folder, { recursive: true });
  return { vertices, drawn, undrawn };
}

/** The page without a program, as it opens: its scene from the first picture on, then from its first step again, drawn and not. */
async function pageTime() {
  const served = await serve("dist");
  const { context, close } = await browser(small);
  const page = await open(context, served.url);
  const found = { opened: { each_second: await eachSecond(page, 4.5) } };
  for (const name of ["drawn", "undrawn"]) {
    if (name === "undrawn") await withoutDrawing(page);
    await page.click("#reset");
    await page.waitForTimeout(200);
    const each = eachSecond(page, 4.5);
    found[name] = { ...(await pace(page, 4)), each_second: await each };
  }
  const { scene, step_ms } = await page.evaluate(() => ({ scene: document.querySelector("#scene").value, step_ms: window.selvedge.state.tracks[0].step_ms }));
  await close();
  await served.stop();
  return { scene, step_ms, ...found };
}

/** Frames per second that arrive in the page, drawn or not. */
async function taken(page, seconds) {
  await page.evaluate(() => {
    const { meters } = window.selvedge;
    window.inner ??= meters.frame.bind(meters);
    const frame = window.inner;
    window.arrived = 0;
    meters.frame = (...rest) => {
      window.arrived += 1;
      frame(...rest);
    };
  });
  await page.waitForTimeout(1000 * seconds);
  return (await page.evaluate(() => window.arrived)) / seconds;
}

console.log(spawnSync(program, ["--version"]).stdout?.toString().trim());
console.log("load before:", spawnSync("cut", ["-d", " ", "-f1-3", "/proc/loadavg"]).stdout.toString().trim());
if (wanted("start")) console.log("start", await startTime());
if (wanted("drag")) console.log("drag", await dragTime());
if (wanted("playback")) console.log("playback", await playback());
if (wanted("page")) console.log("page", await pageTime());
