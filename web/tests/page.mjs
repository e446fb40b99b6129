// The page in a real browser: npm test (after cargo build --release, or with SELVEDGE=PATH).
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { atRest, browser, dragged, home, open, place, position, start, still, until } from "./browser.mjs";

const folder = mkdtempSync(join(tmpdir(), "selvedge-recordings-"));
let served, chrome, page;
const errors = [];

before(async () => {
  served = await start(["--show", "model", "--recordings", folder]);
  chrome = await browser();
  page = await open(chrome.context, served.url, errors);
});

after(async () => {
  await chrome?.close();
  await served?.stop();
  rmSync(folder, { recursive: true, force: true });
});

const handle = (number) => page.evaluate((n) => window.selvedge.stage.frame.goals[n].vertex, number);

const drag = (vertex, dx, dy) => dragged(page, vertex, dx, dy);

test("the cloth is to be seen", async () => {
  const shown = await page.evaluate(() => {
    const { stage } = window.selvedge;
    stage.draw();
    const canvas = document.getElementById("canvas");
    const small = document.createElement("canvas");
    [small.width, small.height] = [200, 120];
    const to = small.getContext("2d");
    to.drawImage(canvas, 0, 0, 200, 120);
    const { data } = to.getImageData(0, 0, 200, 120);
    const at = (x, y) => [...data.slice(4 * (y * 200 + x), 4 * (y * 200 + x) + 3)];
    return { middle: at(100, 55), corner: at(4, 4) };
  });
  // The sandy back of the cloth in the middle of a room that has no colour.
  assert.ok(shown.middle[0] > shown.middle[2] + 30, JSON.stringify(shown));
  assert.ok(Math.abs(shown.corner[2] - shown.corner[0]) < 20, JSON.stringify(shown));
});

test("a handle that is dragged takes the cloth along", async () => {
  const vertex = await handle(0);
  const before = await position(page, vertex);
  const free = await page.evaluate((v) => {
    // The free vertex that is nearest to the handle.
    const { frame } = window.selvedge.stage;
    const p = frame.tracks[0];
    const held = new Set(frame.goals.map((goal) => goal.vertex));
    let best = -1;
    let least = Infinity;
    for (let k = 0; k < p.length / 3; k++) {
      const far = Math.hypot(p[3 * k] - p[3 * v], p[3 * k + 1] - p[3 * v + 1], p[3 * k + 2] - p[3 * v + 2]);
      if (!held.has(k) && far < least) [best, least] = [k, far];
    }
    return best;
  }, vertex);
  const beside = await position(page, free);
  await drag(vertex, 0, -80);
  await until(page, ([v, y]) => window.selvedge.stage.frame.tracks[0][3 * v + 1] > y + 0.1, [vertex, before[1]]);
  await until(page, ([v, y]) => window.selvedge.stage.frame.tracks[0][3 * v + 1] > y + 0.04, [free, beside[1]]);
});

test("any point can be taken hold of, and let go by a double click", async () => {
  const count = await page.evaluate(() => window.selvedge.stage.frame.goals.length);
  const box = await page.locator("#canvas").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 30, box.y + box.height / 2, { steps: 5 });
  await page.mouse.up();
  await until(page, (n) => window.selvedge.stage.frame.goals.length === n + 1, count);
  await still(page);
  const at = await place(page, await handle(count));
  await page.mouse.dblclick(at.x, at.y);
  await until(page, (n) => window.selvedge.stage.frame.goals.length === n, count);
});

test("keys move all handles, and stop with the key", async () => {
  await page.locator("#canvas").focus();
  const before = await position(page, await handle(1));
  await page.keyboard.down("PageUp");
  await until(page, ([v, y]) => window.selvedge.stage.frame.tracks[0][3 * v + 1] > y + 0.1, [await handle(1), before[1]]);
  await page.keyboard.up("PageUp");
  await atRest(page, await handle(1));
});

test("reset brings it back to rest", async () => {
  await home(page);
  // The state comes beside the frames, a little later.
  await until(page, () => window.selvedge.state.tracks[0].strain < 0.4);
});

test("who moves it can be changed while it moves", async () => {
  await page.click("[data-mover=both]");
  await until(page, () => window.selvedge.stage.trackCount === 2 && document.querySelectorAll("#labels span").length === 2);
  assert.deepEqual(await page.locator("#labels span").allTextContents(), ["Learned model", "Physics"]);
  await page.selectOption("#colouring", "difference");
  await until(page, () => !document.getElementById("legend").hidden);
  await page.click("[data-mover=physics]");
  await until(page, () => window.selvedge.stage.trackCount === 1 && window.selvedge.state.tracks[0].kind === "physics");
  await page.click("[data-mover=model]");
  await until(page, () => window.selvedge.state.tracks[0].kind === "model");
  await page.selectOption("#colouring", "plain");
});

test("what is recorded is a file and can be replayed", async () => {
  await page.click("#record");
  await until(page, () => window.selvedge.state.recording?.frames > 20);
  await drag(await handle(0), 40, -40);
  await page.click("#record");
  await until(page, () => window.selvedge.state.can_replay);
  assert.ok(readdirSync(folder).some((name) => name.endsWith(".safetensors")));
  await page.click("#replay");
  await until(page, () => window.selvedge.state.show.kind === "recording");
  await page.click("#pause");
  await page.locator("#time").fill("3");
  await until(page, () => window.selvedge.state.show.frame === 3);
  await page.click("#live");
  await until(page, () => window.selvedge.state.show.kind === "live");
});

test("mesh, material and wind can be chosen while it runs", async () => {
  await page.click("[data-mover=physics]");
  await page.selectOption("#mesh", "triangle");
  await until(page, () => window.selvedge.state.order.mesh?.name === "triangle" && !window.selvedge.state.busy);
  await page.selectOption("#material", "11oz-black-denim");
  await until(page, () => window.selvedge.state.order.material === "11oz-black-denim" && !window.selvedge.state.busy);
  await page.locator("#wind").fill("3");
  await until(page, () => Math.hypot(...window.selvedge.state.wind) > 2.9);
});

test("a picture is saved", async () => {
  const download = page.waitForEvent("download");
  await page.click("#picture");
  const file = await (await download).path();
  assert.ok(existsSync(file));
});

test("several pages watch one session", async () => {
  const other = await open(chrome.context, served.url, errors);
  await until(page, () => window.selvedge.state.viewers === 2);
  await other.close();
  await until(page, () => window.selvedge.state.viewers === 1);
});

test("the page finds the program again when it was started anew", async () => {
  const address = new URL(served.url).host;
  await served.stop();
  await until(page, () => document.body.dataset.link === "lost" || document.body.dataset.link === "connecting");
  const noise = errors.length;
  served = await start(["--show", "model", "--recordings", folder], address);
  await until(page, () => document.body.dataset.link === "open" && window.selvedge.stage.trackCount > 0);
  const time = await page.evaluate(() => window.selvedge.stage.frame.number);
  await until(page, (number) => window.selvedge.stage.frame.number !== number, time);
  // A browser says of every attempt to connect that fails that it failed.
  errors.splice(noise, errors.length, ...errors.slice(noise).filter((text) => !text.includes("WebSocket")));
});

test("the page makes no errors", () => {
  assert.deepEqual(errors.filter((text) => !text.includes("ERR_CONNECTION_REFUSED")), []);
});
