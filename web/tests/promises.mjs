// What docs/src/guides/viewer.md promises, in a real browser: what the model has not seen is said,
// nothing covers what it should not, and hands meet resistance. Part of npm test.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, home, open, place, start, still, until } from "./browser.mjs";

let served, chrome, page;
const errors = [];

before(async () => {
  served = await start(["--show", "model", "--model", "paper"]);
  chrome = await browser({ width: 900, height: 600 });
  page = await open(chrome.context, served.url, errors);
});

after(async () => {
  await chrome?.close();
  await served?.stop();
});

/** Moves a slider as a person does. */
const slide = (id, value) =>
  page.evaluate(
    ([name, to]) => {
      const slider = document.getElementById(name);
      slider.value = to;
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    },
    [id, String(value)],
  );

const handles = () => page.evaluate(() => window.selvedge.stage.frame.goals.map((goal) => goal.vertex));
const remark = (words) => until(page, (text) => document.getElementById("remark").textContent.includes(text), words);
const noRemark = () => until(page, () => document.getElementById("remark").textContent === "");

async function letGo(vertex) {
  await still(page);
  const at = await place(page, vertex);
  await page.mouse.dblclick(at.x, at.y);
  await until(page, (v) => !window.selvedge.stage.frame.goals.some((goal) => goal.vertex === v), vertex);
}

const box = (id) =>
  page.evaluate((name) => {
    const { left, top, right, bottom } = document.getElementById(name).getBoundingClientRect();
    return { left, top, right, bottom };
  }, id);
const overlap = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;

test("wind beyond training is said for as long as it blows", async () => {
  await slide("wind", 3);
  await remark("in still air");
  assert.ok(await page.evaluate(() => document.getElementById("toast").textContent.includes("in still air")));
  await until(page, () => document.getElementById("trust").classList.contains("doubt"));
  await slide("wind", 0);
  await noRemark();
});

test("one handle or none is said, and again after a reset", async () => {
  const [one, other] = await handles();
  await letGo(one);
  await remark("1 handle held");
  await home(page);
  await noRemark();
  await until(page, () => window.selvedge.stage.frame.goals.length === 2);
  await letGo(other);
  await remark("1 handle held");
  await letGo(one);
  await remark("0 handles held");
  await page.click("[data-mover=physics]");
  await noRemark();
  await page.click("[data-mover=model]");
  await remark("0 handles held");
  await home(page);
  await noRemark();
});

test("a handle that is lifted is said for as long as it is higher", async () => {
  await still(page);
  const at = await place(page, (await handles())[0]);
  await page.mouse.move(at.x, at.y);
  await page.mouse.down();
  for (let k = 1; k <= 10; k++) await page.mouse.move(at.x, at.y - 25 * k);
  await remark("different heights");
  await page.mouse.up();
  await home(page);
  await noRemark();
});

test("Home brings back the view of the start", async () => {
  const view = () => page.evaluate(() => window.selvedge.stage.camera.position.toArray());
  await home(page);
  await page.evaluate(() => (window.views = []));
  // The camera goes there by and by: a dozen pictures without a change.
  await until(page, () => {
    const { views } = window;
    views.push(window.selvedge.stage.camera.position.toArray().join());
    return views.length > 12 && new Set(views.slice(-12)).size === 1;
  });
  const first = await view();
  await page.evaluate(() => window.selvedge.stage.camera.position.set(3, 2, 3));
  await page.evaluate(() => window.selvedge.stage.controls.update());
  await home(page);
  await until(
    page,
    (wanted) => Math.hypot(...window.selvedge.stage.camera.position.toArray().map((x, k) => x - wanted[k])) < 0.05,
    first,
  );
});

test("the legend, the bar and the panel do not overlap, whatever the window", async () => {
  await page.selectOption("#colouring", "strain");
  for (const [width, height] of [[1360, 850], [900, 600], [780, 560], [390, 844], [360, 640]]) {
    await page.setViewportSize({ width, height });
    await until(page, (narrow) => document.body.classList.contains("wide") === narrow, width <= 760);
    const [legend, bar, panel] = [await box("legend"), await box("bar"), await box("panel")];
    assert.ok(legend.right > legend.left && bar.right > bar.left, `${width} × ${height}`);
    assert.ok(!overlap(legend, bar), `legend and bar, ${width} × ${height}`);
    assert.ok(!overlap(legend, panel), `legend and panel, ${width} × ${height}`);
    assert.ok(!overlap(bar, panel), `bar and panel, ${width} × ${height}`);
  }
  await page.setViewportSize({ width: 900, height: 600 });
  await page.selectOption("#colouring", "plain");
});

test("the focus of the canvas is to be seen", async () => {
  const edge = { clip: { x: 0, y: 250, width: 3, height: 12 } };
  await page.evaluate(() => document.activeElement?.blur());
  const without = await page.screenshot(edge);
  await page.keyboard.press("Tab");
  await page.locator("#canvas").focus();
  await page.keyboard.press("Shift");
  const focused = await page.screenshot(edge);
  assert.notDeepEqual(focused, without);
  assert.ok(await page.evaluate(() => document.getElementById("canvas").matches(":focus-visible")));
});

test("a notice covers no handle on a phone", async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  await slide("wind", 2);
  // It goes after some seconds, and its place is looked up while it is there.
  const shown = await until(page, () => {
    const notice = document.getElementById("toast");
    const { left, top, right, bottom } = notice.getBoundingClientRect();
    return notice.hidden ? null : { left, top, right, bottom };
  });
  const toast = await shown.jsonValue();
  assert.ok(toast.right > toast.left && toast.bottom > toast.top, JSON.stringify(toast));
  await still(page);
  for (const vertex of await handles()) {
    const { x, y } = await place(page, vertex);
    const knob = { left: x - 28, top: y - 28, right: x + 28, bottom: y + 28 };
    assert.ok(!overlap(toast, knob), JSON.stringify({ toast, knob }));
  }
  // What lies under it can be taken hold of all the same.
  assert.equal(await page.evaluate(() => getComputedStyle(document.getElementById("toast")).pointerEvents), "none");
  await slide("wind", 0);
  await page.setViewportSize({ width: 900, height: 600 });
  await noRemark();
});

test("a handle that is pulled farther than the cloth is long resists", async () => {
  await home(page);
  const [one, other] = await handles();
  const apart = () =>
    page.evaluate(
      ([a, b]) => window.selvedge.stage.point(0, a).distanceTo(window.selvedge.stage.point(0, b)),
      [one, other],
    );
  // The upper edge of the shipped scene is 1 m long.
  assert.ok(Math.abs((await apart()) - 1) < 0.05);
  await page.evaluate(
    ([a, b]) => {
      const { stage } = window.selvedge;
      const [from, to] = [stage.point(0, b), stage.point(0, a)];
      const goal = to.clone().add(to.clone().sub(from).multiplyScalar(2));
      window.selvedge.drag([{ vertex: a, x: goal.x, y: goal.y, z: goal.z }]);
    },
    [one, other],
  );
  await until(
    page,
    ([a, b]) => window.selvedge.stage.point(0, a).distanceTo(window.selvedge.stage.point(0, b)) > 1.09,
    [one, other],
  );
  await page.waitForTimeout(1500);
  assert.ok((await apart()) < 1.11, String(await apart()));
  assert.ok(await page.evaluate(() => window.selvedge.state.tracks[0].strain < 0.35));
  await home(page);
});

test("a free corner is taken hold of from beside it", async () => {
  await still(page);
  const found = await page.evaluate(() => {
    const { stage } = window.selvedge;
    const held = new Set(stage.frame.goals.map((goal) => goal.vertex));
    const count = stage.frame.tracks[0].length / 3;
    const places = Array.from({ length: count }, (_, v) => stage.onScreen(stage.point(0, v)));
    const middle = places.reduce((m, p) => ({ x: m.x + p.x / count, y: m.y + p.y / count }), { x: 0, y: 0 });
    // The free vertex that is farthest from the middle of the cloth on the page.
    const far = (p) => Math.hypot(p.x - middle.x, p.y - middle.y);
    let corner = -1;
    places.forEach((p, v) => !held.has(v) && (corner < 0 || far(p) > far(places[corner])) && (corner = v));
    const at = places[corner];
    const out = 9 / far(at);
    const hit = stage.pick(at.x + out * (at.x - middle.x), at.y + out * (at.y - middle.y), 16);
    const nothing = stage.pick(at.x + 4 * out * (at.x - middle.x), at.y + 4 * out * (at.y - middle.y), 16);
    return { corner, hit: hit?.vertex, nothing };
  });
  assert.equal(found.hit, found.corner);
  assert.equal(found.nothing, null);
});

test("labels of two cloths, one over the other, are both to be read", async () => {
  await page.click("[data-mover=both]");
  await until(page, () => window.selvedge.stage.trackCount === 2 && document.querySelectorAll("#labels span").length === 2);
  await page.check("#together");
  await until(page, () => {
    const [a, b] = [...document.querySelectorAll("#labels span")].map((span) => span.getBoundingClientRect());
    return a && b && (a.bottom <= b.top || b.bottom <= a.top) && Math.abs(a.left + a.right - b.left - b.right) < 4;
  });
  await page.uncheck("#together");
  await page.click("[data-mover=model]");
  await until(page, () => window.selvedge.stage.trackCount === 1);
});

test("the weave makes no moiré: from afar the cloth is as smooth as without it", async () => {
  const fine = await open(chrome.context, `${served.url}?full`, errors);
  await fine.click("#pause");
  const rough = () =>
    fine.evaluate(() => {
      const { stage } = window.selvedge;
      stage.draw();
      const canvas = document.getElementById("canvas");
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [canvas.width, canvas.height];
      const to = copy.getContext("2d", { willReadFrequently: true });
      to.drawImage(canvas, 0, 0);
      // A part of the cloth around its middle, and how much a pixel differs from its neighbours.
      const count = stage.frame.tracks[0].length / 3;
      const scale = canvas.width / canvas.getBoundingClientRect().width;
      let [x, y] = [0, 0];
      for (let v = 0; v < count; v++) {
        const at = stage.onScreen(stage.point(0, v));
        [x, y] = [x + (scale * at.x) / count, y + (scale * at.y) / count];
      }
      const half = Math.round(18 * scale);
      const size = 2 * half;
      const { data } = to.getImageData(Math.round(x) - half, Math.round(y) - half, size, size);
      const light = (i, j) => data[4 * (j * size + i)] + data[4 * (j * size + i) + 1] + data[4 * (j * size + i) + 2];
      let sum = 0;
      for (let j = 1; j + 1 < size; j++) {
        for (let i = 1; i + 1 < size; i++) {
          sum += Math.abs(4 * light(i, j) - light(i - 1, j) - light(i + 1, j) - light(i, j - 1) - light(i, j + 1)) / 4;
        }
      }
      return sum / (size - 2) ** 2;
    });
  const away = (times) =>
    fine.evaluate((far) => {
      const { stage } = window.selvedge;
      stage.fit();
      stage.camera.position.sub(stage.controls.target).multiplyScalar(far).add(stage.controls.target);
      stage.controls.update();
    }, times);
  const weave = (shown) =>
    fine.evaluate((isShown) => {
      for (const { material } of window.selvedge.stage.objects) {
        window.weave ??= material.normalMap;
        material.normalMap = isShown ? window.weave : null;
        material.needsUpdate = true;
      }
    }, shown);
  for (const times of [1, 1.6, 2.4]) {
    await away(times);
    const woven = await rough();
    await weave(false);
    const plain = await rough();
    await weave(true);
    // A level of brightness in 255 per colour, at most.
    assert.ok(woven < plain + 3, JSON.stringify({ times, woven, plain }));
  }
  await fine.click("#pause");
  await fine.close();
});

test("a dead program is said in the page, and the meters stop", async () => {
  const noise = errors.length;
  await served.stop();
  await until(page, () => document.getElementById("slow").textContent.includes("does not answer"));
  assert.ok(await page.evaluate(() => !document.getElementById("slow").hidden));
  for (const id of ["fps", "steps", "step-ms", "strain"]) {
    assert.equal(await page.locator(`#${id}`).textContent(), "–");
  }
  errors.splice(noise);
  assert.deepEqual(errors, []);
});
