// Pictures of the page for people to look at: light, dark, phone, colours, side by side; and what
// hands do, by the model that MODEL names beside the physics: let-go, lift, blow, pull.
// node tests/shots.mjs FOLDER [NAME...]
import { mkdirSync } from "node:fs";
import { browser, open, place, start, still, until } from "./browser.mjs";

const [folder = "shots", ...names] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });
const wait = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));
const wanted = (name) => names.length === 0 || names.includes(name);

async function shot(name, { size, scheme = "light", args = [], touch = false }, act) {
  if (!wanted(name)) return;
  const served = await start(args);
  const { context, close } = await browser(size, { colorScheme: scheme, hasTouch: touch, deviceScaleFactor: touch ? 2 : 1 });
  const errors = [];
  const page = await open(context, `${served.url}?full`, errors);
  // Software GL says nothing of how fast pictures and steps are elsewhere: of the meters only strain stays.
  await page.addStyleTag({ content: "#meters > div:not(#trust-box), #slow { display: none }" });
  await act(page);
  await page.screenshot({ path: `${folder}/${name}.png` });
  console.log(name, errors);
  await close();
  await served.stop();
}

/** Pulls a vertex across the page, and keeps hold of it. */
async function pull(page, vertex, [dx, dy]) {
  const from = await place(page, vertex);
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let k = 1; k <= 15; k++) {
    await page.mouse.move(from.x + (dx * k) / 15, from.y + (dy * k) / 15);
    await wait(0.04);
  }
}

const handle = (page, number) => page.evaluate((n) => window.selvedge.stage.frame.goals[n].vertex, number);
const choose = (page, id, value) => page.selectOption(`#${id}`, value);
const desk = { width: 1360, height: 850 };

/** Moves a slider as a person does. */
const slide = (page, id, value) =>
  page.evaluate(
    ([name, to]) => {
      const slider = document.getElementById(name);
      slider.value = to;
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    },
    [id, String(value)],
  );

/** Waits until the session has stepped for so many seconds of the cloth's own time. */
async function moved(page, seconds) {
  const from = await page.evaluate(() => window.selvedge.stage.frame.time);
  await until(page, (time) => window.selvedge.stage.frame.time >= time, from + seconds);
}

await shot("light", { size: desk }, async (page) => {
  await wait(1.5);
  await pull(page, await handle(page, 1), [60, -130]);
  await wait(1);
});
await shot("dark", { size: desk, scheme: "dark" }, async (page) => {
  await choose(page, "motion", "snake");
  await page.click("#play-motion");
  await wait(5);
});
await shot("strain", { size: desk }, async (page) => {
  await choose(page, "colouring", "strain");
  await page.check("#edges");
  await wait(1);
  await pull(page, await handle(page, 0), [-90, -190]);
  await wait(0.6);
});
await shot("both", { size: desk, args: ["--show", "both"] }, async (page) => {
  await choose(page, "motion", "test-x-minus-z");
  await page.click("#play-motion");
  await wait(6);
});
await shot("difference", { size: desk, scheme: "dark", args: ["--show", "both"] }, async (page) => {
  await choose(page, "colouring", "difference");
  await choose(page, "motion", "snake");
  await page.click("#play-motion");
  await wait(6);
});
/** The table-cloth once it has fallen, paused. */
async function fallen(page) {
  await moved(page, 2);
  await page.click("#pause");
  await until(page, () => !window.selvedge.state.running);
  await wait(1);
}
await shot("gap", { size: desk, args: ["tablecloth"] }, async (page) => {
  await choose(page, "colouring", "gap");
  await fallen(page);
});
await shot("table", { size: desk, args: ["tablecloth"] }, fallen);
await shot("phone", { size: { width: 390, height: 844 }, touch: true, args: ["tablecloth"] }, fallen);
await shot("phone-panel", { size: { width: 390, height: 844 }, scheme: "dark", touch: true }, async (page) => {
  await wait(1);
  await page.click("#settings");
  await wait(1);
});
await shot("laptop", { size: { width: 1280, height: 720 } }, async (page) => {
  await choose(page, "mesh", "l-shape");
  await page.waitForFunction(() => window.selvedge.state.generation === 2);
  await wait(2);
});

// The model and the physics under the same hands.
const args = ["--model", process.env.MODEL ?? "paper", "--show", "both"];
await shot("let-go", { size: desk, args }, async (page) => {
  await still(page);
  const at = await place(page, await handle(page, 0));
  await page.mouse.dblclick(at.x, at.y);
  await until(page, () => window.selvedge.stage.frame.goals.length === 1);
  await moved(page, 4);
});
await shot("lift", { size: desk, args }, async (page) => {
  await still(page);
  await pull(page, await handle(page, 1), [0, -190]);
  await moved(page, 3);
});
await shot("blow", { size: desk, args }, async (page) => {
  await slide(page, "wind", 6);
  await moved(page, 5);
});
await shot("pull", { size: desk, args }, async (page) => {
  await still(page);
  // A vertex in the middle of the cloth.
  const vertex = await page.evaluate(() => {
    const { tracks } = window.selvedge.stage.frame;
    const points = [...Array(tracks[0].length / 3).keys()].map((v) => [...tracks[0].slice(3 * v, 3 * v + 3)]);
    const middle = [0, 1, 2].map((k) => points.reduce((sum, p) => sum + p[k], 0) / points.length);
    const away = points.map((p) => Math.hypot(...p.map((x, k) => x - middle[k])));
    return away.indexOf(Math.min(...away));
  });
  await pull(page, vertex, [150, -60]);
  await moved(page, 2);
});
