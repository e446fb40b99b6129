// What tests and measurements share: the program, started on a free port, and a page of it in
// Debian's Chromium, headless, with software GL.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

/** The program to try: SELVEDGE, or the release build. */
export const program = process.env.SELVEDGE ?? "../target/release/selvedge";

/** Time that anything may take, ms; PATIENCE (s) says so where a machine is busy otherwise. */
const patience = 1000 * Number(process.env.PATIENCE ?? 60);

/** Starts `selvedge view` with `args`; gives its address and a way to end it. */
export async function start(args = [], address = "127.0.0.1:0") {
  const began = performance.now();
  // The tests drag the handles of a hanging square, unless they name a scene.
  const scene = args.length === 0 || args[0].startsWith("--") ? ["default"] : [];
  const child = spawn(program, ["view", ...scene, ...args, "--address", address], { stdio: ["ignore", "pipe", "pipe"] });
  let said = "";
  const url = await new Promise((resolve, reject) => {
    child.stderr.on("data", (data) => {
      said += data;
      const found = /http:\/\/\S+/.exec(said);
      if (found) resolve(found[0]);
    });
    child.on("exit", (code) => reject(new Error(`the program ended with ${code}: ${said}`)));
    child.on("error", reject);
  });
  const stop = () =>
    new Promise((resolve) => {
      child.removeAllListeners("exit");
      child.on("exit", resolve);
      child.kill("SIGINT");
    });
  return { url, stop, began, pid: child.pid };
}

/** A browser of its own, with an empty profile. */
export async function browser(size = { width: 1360, height: 850 }, more = {}) {
  const profile = mkdtempSync(join(tmpdir(), "selvedge-browser-"));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    headless: true,
    timeout: patience,
    viewport: size,
    args: [
      "--no-sandbox",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--use-gl=angle",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--ignore-gpu-blocklist",
    ],
    ...more,
  });
  context.setDefaultTimeout(patience);
  context.setDefaultNavigationTimeout(patience);
  const close = async () => {
    await context.close();
    rmSync(profile, { recursive: true, force: true });
  };
  return { context, close };
}

/** Opens the page and waits until a cloth is drawn. Errors of the page go to `errors`. */
export async function open(context, url, errors = []) {
  const page = await context.newPage();
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("pageerror", (error) => errors.push(String(error)));
  await page.goto(url);
  await page.waitForFunction(() => window.selvedge?.stage.trackCount > 0, null, { timeout: patience });
  return page;
}

/** Where vertex `vertex` of track `track` is on the page, in pixels. */
export function place(page, vertex, track = 0) {
  return page.evaluate(
    ([v, t]) => {
      const { stage } = window.selvedge;
      const at = stage.onScreen(stage.point(t, v));
      const size = document.getElementById("canvas").getBoundingClientRect();
      return { x: at.x + size.left, y: at.y + size.top };
    },
    [vertex, track],
  );
}

/** The positions of a vertex now. */
export function position(page, vertex, track = 0) {
  return page.evaluate(([v, t]) => [...window.selvedge.stage.frame.tracks[t].slice(3 * v, 3 * v + 3)], [vertex, track]);
}

/** Waits until `check`, evaluated in the page with `argument`, holds. */
export const until = (page, check, argument = null) => page.waitForFunction(check, argument, { timeout: patience });

/** Frames in which what moves must have moved: a tenth of a second and more. */
const FRAMES = 10;

/**
 * Waits until handles and view stand still, so that places on the page hold until something is
 * done. On a busy machine two looks may see one frame: it is frames that must be alike, many.
 */
export async function still(page) {
  await page.evaluate(() => (window.before = null));
  await until(page, (frames) => {
    const { stage } = window.selvedge;
    const { number, goals } = stage.frame;
    const now = goals.map((goal) => Object.values(stage.onScreen(stage.point(0, goal.vertex))).map(Math.round)).join();
    if (now !== window.before?.now) window.before = { now, number };
    return number >= window.before.number + frames;
  }, FRAMES);
}

/** Waits until a vertex is where it was in many frames before, to the bit. */
export async function atRest(page, vertex) {
  await page.evaluate(() => (window.before = null));
  await until(page, ([v, frames]) => {
    const { number, tracks } = window.selvedge.stage.frame;
    const now = tracks[0].slice(3 * v, 3 * v + 3).join();
    if (now !== window.before?.now) window.before = { now, number };
    return number >= window.before.number + frames;
  }, [vertex, FRAMES]);
}

/**
 * Presses Home and waits until the scene has begun anew. Each frame is looked at as it arrives: one
 * that is polled for could be over before a busy page looks again, and a scene that has just begun
 * has no earlier time to go back to, so that its first tenth of a second is waited for.
 */
export async function home(page) {
  await page.locator("#canvas").focus();
  await until(page, () => window.selvedge.stage.frame.time > 0.1);
  await page.evaluate(() => {
    const { stage } = window.selvedge;
    window.beganAnew = false;
    stage.take = (frame) => {
      if (frame.time < stage.frame.time) window.beganAnew = true;
      Object.getPrototypeOf(stage).take.call(stage, frame);
      if (window.beganAnew) delete stage.take;
    };
  });
  await page.keyboard.press("Home");
  await until(page, () => window.beganAnew);
}

/** Drags a vertex across the page by some pixels. */
export async function dragged(page, vertex, dx, dy) {
  const from = await place(page, vertex);
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let k = 1; k <= 10; k++) {
    await page.mouse.move(from.x + (dx * k) / 10, from.y + (dy * k) / 10);
    await page.waitForTimeout(30);
  }
  await page.mouse.up();
}
