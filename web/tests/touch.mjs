// Cloth that touches, in the page: obstacles that are drawn and led, a floor, a ball that is
// thrown, cloth that is dropped, and gaps as a colour. Part of npm test.
import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, home, open, start, until } from "./browser.mjs";

const SCENE = `name = "ball and sheet"
material = "gray-interlock"
start = "mesh"
mesh = { generator = { kind = "square", vertices = 100, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }
motion = { named = "forward" }
contact = { friction = 0.3 }
obstacles = [
    { name = "ball", sphere = { radius = 0.15 }, transform = { translation = [0.4, -0.4, 0] }, motion = { keyframes = [{ time = 0.5 }, { time = 1.5, translation = [0.1, 0, 0] }] } },
    { name = "ground", plane = { height = -1.3 } },
]
`;

const folder = mkdtempSync(join(tmpdir(), "selvedge-touch-"));
const scene = join(folder, "ball.toml");
let served, chrome, page;
const errors = [];

before(async () => {
  writeFileSync(scene, SCENE);
  served = await start([scene, "--show", "physics", "--recordings", join(folder, "recordings")]);
  chrome = await browser();
  page = await open(chrome.context, served.url, errors);
});

after(async () => {
  await chrome?.close();
  await served?.stop();
  rmSync(folder, { recursive: true, force: true });
});

/** The middle of a body now, and the number of the ball. */
const middle = (body) => page.evaluate((b) => window.selvedge.stage.bodies.middle(b).toArray(), body);
const ball = () => page.evaluate(() => window.selvedge.stage.bodies.ball);
const onPage = (point) =>
  page.evaluate((p) => {
    const { stage } = window.selvedge;
    const at = stage.onScreen(stage.controls.target.clone().set(...p));
    const size = document.getElementById("canvas").getBoundingClientRect();
    return { x: at.x + size.left, y: at.y + size.top };
  }, point);

/** Waits until the body of this number is farther than `far` from `from`. */
const moved = (body, from, far) =>
  until(page, ([b, p, d]) => window.selvedge.stage.bodies.middle(b).distanceTo({ x: p[0], y: p[1], z: p[2] }) > d, [body, from, far]);

test("obstacles are drawn, move as the scene says, and the floor is where it has it", async () => {
  const { count, floor, faces } = await page.evaluate(() => {
    const { stage } = window.selvedge;
    stage.draw();
    const meshes = stage.bodies.group.children;
    return {
      count: meshes.length,
      floor: stage.bodies.floor,
      faces: meshes.filter((mesh) => mesh.visible).map((mesh) => mesh.geometry.index.count / 3),
    };
  });
  assert.equal(await page.isChecked("#touches"), true);
  assert.equal(await page.isDisabled("#touches"), true);
  // The scene's two, and the ball that waits out of sight.
  assert.equal(count, 3);
  assert.ok(Math.abs(floor + 1.3) < 1e-5, String(floor));
  assert.equal(faces.length, 1);
  assert.ok(faces[0] > 100, String(faces));
  await home(page);
  await page.evaluate(() => {
    // Each frame as it arrives: a busy page may not draw the first ones.
    const { stage } = window.selvedge;
    const take = stage.take.bind(stage);
    window.least = Infinity;
    stage.take = (frame) => {
      window.least = Math.min(window.least, frame.bodies[0]);
      take(frame);
    };
  });
  await page.click("#reset");
  await until(page, () => window.selvedge.stage.frame.bodies[0] > window.least + 0.09);
  await until(page, () => window.selvedge.stage.bodies.middle(0).x > 0.49);
});

test("an obstacle is led by hand, no faster than the limits let it, and stays apart from the cloth", async () => {
  await home(page);
  const before = await middle(0);
  const from = await onPage(before);
  await page.evaluate(() => {
    window.steps = [];
    const { stage } = window.selvedge;
    const take = stage.take.bind(stage);
    let last = null;
    stage.take = (frame) => {
      const x = frame.bodies.slice(0, 3);
      if (last) window.steps.push(Math.hypot(...x.map((p, k) => p - last.x[k])) / Math.max(frame.time - last.time, 1e-9));
      last = { x, time: frame.time };
      take(frame);
    };
  });
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let k = 1; k <= 10; k++) {
    await page.mouse.move(from.x - 15 * k, from.y - 6 * k);
    await page.waitForTimeout(30);
  }
  await moved(0, before, 0.15);
  await page.mouse.up();
  const steps = await page.evaluate(() => window.steps.filter((speed) => Number.isFinite(speed)));
  const fastest = Math.max(...steps);
  const limit = await page.evaluate(() => window.selvedge.state.limits.speed);
  // The scene's own motion of 0.1 m in a second is added to it.
  assert.ok(fastest < 1.05 * limit + 0.25, `${fastest} of ${limit}`);
  assert.equal(await page.evaluate(() => window.selvedge.state.tracks[0].stopped), null);
});

test("a ball that is thrown pushes the sheet, and falls on the floor", async () => {
  await home(page);
  const number = await ball();
  const still = await page.evaluate(() => [...window.selvedge.stage.frame.tracks[0]]);
  const target = await onPage([0, -0.55, 0.15]);
  await page.click("#throw");
  assert.equal(await page.getAttribute("#throw", "aria-pressed"), "true");
  await page.mouse.click(target.x, target.y);
  assert.equal(await page.getAttribute("#throw", "aria-pressed"), "false");
  await until(page, (before) => {
    const now = window.selvedge.stage.frame.tracks[0];
    return before.some((x, k) => Math.abs(now[k] - x) > 0.12);
  }, still);
  // On the floor, a radius above it.
  await until(page, (b) => window.selvedge.stage.bodies.middle(b).y < -1.1, number);
  await page.waitForTimeout(500);
  const at = await middle(number);
  assert.ok(at[1] > -1.3 + 0.11, String(at));
  assert.equal(await page.evaluate(() => window.selvedge.state.tracks[0].stopped), null);
});

test("gaps are a colour", async () => {
  await page.selectOption("#colouring", "gap");
  await until(page, () => window.selvedge.stage.frame.gaps[0]?.length === window.selvedge.stage.frame.tracks[0].length / 3);
  assert.equal(await page.isVisible("#legend"), true);
  assert.match(await page.textContent("#legend-title"), /Gap/);
  const gaps = await page.evaluate(() => [...window.selvedge.stage.frame.gaps[0]]);
  assert.ok(gaps.every((gap) => gap > 1e-5 && gap <= 0.0201), String(gaps.slice(0, 9)));
  await page.selectOption("#colouring", "plain");
  await until(page, () => window.selvedge.stage.frame.gaps.length === 0);
});

test("cloth of a scene without contact gets a floor, is dropped on it and stays above it", async () => {
  await page.selectOption("#scene", "square-1024");
  await until(page, () => window.selvedge.state.order.scene === "square-1024" && window.selvedge.state.busy === null);
  assert.equal(await page.evaluate(() => window.selvedge.state.touches), false);
  assert.equal(await page.isDisabled("#throw"), true);
  await page.selectOption("#mesh", "square");
  await until(page, () => window.selvedge.state.busy === null && window.selvedge.state.order.mesh?.name === "square");
  await page.selectOption("#vertices", "150");
  await until(page, () => window.selvedge.state.busy === null && window.selvedge.stage.frame?.tracks[0].length <= 3 * 200);
  await page.check("#touches");
  await until(page, () => window.selvedge.state.touches && window.selvedge.state.busy === null && window.selvedge.stage.frame);
  const floor = await page.evaluate(() => window.selvedge.stage.bodies.floor);
  assert.ok(floor < -1, String(floor));
  await page.click("#drop");
  const lowest = (y) => {
    const p = window.selvedge.stage.frame.tracks[0];
    let low = Infinity;
    for (let k = 1; k < p.length; k += 3) low = Math.min(low, p[k]);
    return low < y + 0.02;
  };
  await until(page, lowest, floor);
  // Most of it lies there after a while, and nothing is below.
  await until(page, (y) => window.selvedge.stage.frame.tracks[0].every((z, k) => k % 3 !== 1 || z < y + 0.9), floor);
  const heights = await page.evaluate(() => [...window.selvedge.stage.frame.tracks[0]].filter((_, k) => k % 3 === 1));
  assert.ok(Math.min(...heights) > floor, `${Math.min(...heights)} at ${floor}`);
  assert.ok(Math.max(...heights) < floor + 1, `${Math.max(...heights)} at ${floor}`);
  assert.equal(await page.evaluate(() => window.selvedge.state.tracks[0].stopped), null);
});

test("nothing went wrong in the page", () => assert.deepEqual(errors, []));
