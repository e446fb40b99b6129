// The page that needs no program, in a real browser, served as files: npm run build:static, then
// npm run test:static.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, dragged, open, place, position, until } from "./browser.mjs";
import { serve } from "./server.mjs";

let served, chrome, page;
const errors = [];

before(async () => {
  served = await serve("dist");
  chrome = await browser();
  page = await open(chrome.context, `${served.url}?scene=default`, errors);
});

after(async () => {
  await chrome?.close();
  await served?.stop();
});

const state = (check) => until(page, check);

const drag = (vertex, dx, dy) => dragged(page, vertex, dx, dy);

test("a handle that is dragged takes the cloth along", async () => {
  const vertex = await page.evaluate(() => window.selvedge.stage.frame.goals[0].vertex);
  const before = await position(page, vertex);
  await drag(vertex, 0, -80);
  await until(page, ([v, y]) => window.selvedge.stage.frame.tracks[0][3 * v + 1] > y + 0.1, [vertex, before[1]]);
});

test("the learned model moves the cloth, and both do, side by side", async () => {
  await page.click('[data-mover="model"]');
  await state(() => window.selvedge.state.tracks[0]?.kind === "model" && window.selvedge.state.tracks[0].step_ms > 0);
  await page.click('[data-mover="both"]');
  await state(() => window.selvedge.stage.trackCount === 2);
  await page.click('[data-mover="physics"]');
  await state(() => window.selvedge.stage.trackCount === 1);
});

test("a recording is saved by the browser, as a .glb that replays", async () => {
  await page.click("#record");
  await state(() => window.selvedge.state.recording?.frames > 20);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#record")]);
  assert.equal(download.suggestedFilename(), "recording-1-physics.glb");
  const bytes = readFileSync(await download.path());
  assert.equal(bytes.subarray(0, 4).toString(), "glTF");
  assert.equal(bytes.readUInt32LE(8), bytes.length);
  await page.click("#replay");
  await state(() => window.selvedge.state.show.kind === "recording");
  await page.click("#live");
  await state(() => window.selvedge.state.show.kind === "live");
});

test("a page that is one file opens without a server, with its scene", async (context) => {
  const folder = mkdtempSync(join(tmpdir(), "selvedge-single-"));
  context.after(() => rmSync(folder, { recursive: true, force: true }));
  execFileSync("node", ["single.mjs", folder, "poncho"]);
  const errors = [];
  const other = await open(chrome.context, `file://${join(folder, "poncho.html")}`, errors);
  await until(other, () => window.selvedge.stage.frame.time > 0.2);
  assert.equal(await other.inputValue("#scene"), "poncho");
  assert.deepEqual(errors, []);
  await other.close();
});

test("every scene of the menu is made, and moves", async () => {
  const scenes = await page.locator("#scene option").evaluateAll((options) => options.map((option) => option.value));
  assert.ok(scenes.includes("tablecloth") && scenes.includes("poncho"), String(scenes));
  for (const scene of scenes) {
    await page.selectOption("#scene", scene);
    await until(page, (name) => window.selvedge.state.order.scene === name && !window.selvedge.state.busy, scene);
    await until(page, () => window.selvedge.stage.frame.time > 0.05);
  }
});

test("a ball is thrown into the cloth", async () => {
  await page.selectOption("#scene", "default");
  await until(page, () => window.selvedge.state.order.scene === "default" && !window.selvedge.state.busy);
  await page.check("#touches");
  await until(page, () => window.selvedge.state.touches && !window.selvedge.state.busy);
  await page.click("#throw");
  const middle = await place(page, 200);
  await page.mouse.click(middle.x, middle.y);
  await until(page, () => {
    const { frame } = window.selvedge.stage;
    // The ball is the last body; away it is a kilometre below.
    return frame.bodies[frame.bodies.length - 2] > -10;
  });
  await page.click("#drop");
  await state(() => window.selvedge.stage.frame.goals.length === 0);
});

test("out of sight, time stands still", async () => {
  const other = await chrome.context.newPage();
  await other.setContent(`<div style="height: 3000px"></div><iframe src="${served.url}?figure&scene=tablecloth" width="600" height="400"></iframe>`);
  const frame = other.frames().find((frame) => frame.url().includes("figure"));
  // Nothing is drawn out of sight: there are no pictures to wait for.
  await frame.waitForFunction(() => window.selvedge?.stage.frame, null, { polling: 100 });
  await other.waitForTimeout(500);
  const time = () => frame.evaluate(() => window.selvedge.stage.frame?.time ?? 0);
  const hidden = await time();
  await other.waitForTimeout(500);
  assert.equal(await time(), hidden);
  await other.evaluate(() => scrollTo(0, 3000));
  await frame.waitForFunction((before) => window.selvedge.stage.frame.time > before + 0.2, hidden);
  assert.equal(await frame.locator("#panel").isVisible(), false);
  await other.close();
});

test("a picture of the book becomes the cloth that it shows, where the page is beside the book", async () => {
  const book = mkdtempSync(join(tmpdir(), "selvedge-book-"));
  const picture = "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='320' height='200'/>#live=tablecloth";
  mkdirSync(join(book, "guides"));
  copyFileSync("../docs/live.js", join(book, "live.js"));
  writeFileSync(join(book, "guides/index.html"), `<!doctype html><script>var path_to_root = "../"</script><img alt="a cloth" src="${picture}"><script src="../live.js"></script>`);
  const library = await serve(book);
  const other = await chrome.context.newPage();
  await other.goto(`${library.url}guides/`);
  await other.waitForTimeout(500);
  // A book alone keeps its picture.
  assert.equal(await other.locator("img").count(), 1);
  cpSync("dist", join(book, "live"), { recursive: true });
  await other.reload();
  const figure = other.frameLocator("iframe[title='a cloth']");
  await figure.locator("#canvas").waitFor();
  const frame = other.frames().find((frame) => frame.url().includes("live/index.html"));
  await frame.waitForFunction(() => window.selvedge?.stage.frame?.time > 0.2);
  await other.close();
  await library.stop();
  rmSync(book, { recursive: true });
});

test("a scene that is not there is said", async () => {
  const other = await chrome.context.newPage();
  await other.goto(`${served.url}?scene=tableclot`);
  // With those that there are, a red light, and no floor that waits for a cloth.
  await other.waitForFunction(() => /tableclot\b.*tablecloth/s.test(document.getElementById("toast").textContent));
  assert.equal(await other.locator("#link").getAttribute("class"), "dot bad");
  assert.equal(await other.evaluate(() => document.body.dataset.link), "refused");
  await other.close();
});

test("nothing of the page has failed", () => assert.deepEqual(errors, []));
