// What can be looked at without a browser. The marks of handles: however many there are, each has
// its knob, and the buffers are made anew only when they are full. Places on the screen.
import assert from "node:assert/strict";
import { test } from "node:test";
import { build } from "esbuild";

const bundled = await build({
  stdin: {
    contents:
      'export { HandleMarks } from "./src/handles"; export { Vector3 } from "three"; export * from "./src/places";',
    resolveDir: process.cwd(),
    loader: "ts",
  },
  bundle: true,
  format: "esm",
  write: false,
});
const { HandleMarks, Vector3, labelPlace, nearest } = await import(
  `data:text/javascript;base64,${Buffer.from(bundled.outputFiles[0].contents).toString("base64")}`
);

/** Draws `count` handles that are each wanted a metre higher. */
function draw(marks, count) {
  marks.begin();
  for (let k = 0; k < count; k++) marks.add(new Vector3(k, 0, 0), new Vector3(k, 1, 0), false);
  marks.end();
}

const knobs = (marks) => marks.group.children.find((child) => child.isInstancedMesh);
const lines = (marks) => marks.group.children.find((child) => child.isLineSegments);

test("a thousand handles are all marked", () => {
  const marks = new HandleMarks();
  draw(marks, 1000);
  assert.equal(knobs(marks).count, 2000);
  assert.equal(lines(marks).geometry.drawRange.count, 2000);
  // The last handle and its goal.
  const at = (index) => [...knobs(marks).instanceMatrix.array.slice(16 * index + 12, 16 * index + 15)];
  assert.deepEqual(at(1998), [999, 0, 0]);
  assert.deepEqual(at(1999), [999, 1, 0]);
  const ends = lines(marks).geometry.getAttribute("position").array;
  assert.deepEqual([...ends.slice(3 * 1998, 3 * 2000)], [999, 0, 0, 999, 1, 0]);
  assert.equal(marks.group.children.length, 2);
});

test("the same buffers serve every picture", () => {
  const marks = new HandleMarks();
  draw(marks, 20);
  const before = [knobs(marks), lines(marks).geometry.getAttribute("position")];
  for (let picture = 0; picture < 10; picture++) draw(marks, 10 + picture);
  assert.deepEqual([knobs(marks), lines(marks).geometry.getAttribute("position")], before);
  draw(marks, 0);
  assert.equal(knobs(marks).count, 0);
  assert.equal(lines(marks).visible, false);
});

test("labels of cloths that lie one over the other do not overlap", () => {
  const first = labelPlace({ x: 300, y: 400 });
  assert.deepEqual(first, { x: 300, y: 384 });
  // The other cloth's top is where it may be: its label stands above the first one.
  for (const y of [380, 400, 430]) {
    assert.deepEqual(labelPlace({ x: 310, y }, first), { x: 300, y: 354 });
  }
  // At the upper edge, below it.
  const high = labelPlace({ x: 300, y: 20 });
  assert.deepEqual(high, { x: 300, y: 80 });
  assert.deepEqual(labelPlace({ x: 300, y: 20 }, high), { x: 300, y: 110 });
  // Side by side each stands over its own cloth.
  assert.deepEqual(labelPlace({ x: 600, y: 390 }), { x: 600, y: 374 });
});

test("a corner is found from a little beside it", () => {
  const corners = [{ x: 100, y: 100 }, { x: 200, y: 100 }, { x: 200, y: 220 }];
  assert.equal(nearest(corners, { x: 208, y: 230 }, 16), 2);
  assert.equal(nearest(corners, { x: 92, y: 95 }, 16), 0);
  assert.equal(nearest(corners, { x: 150, y: 150 }, 16), -1);
  assert.equal(nearest([], { x: 0, y: 0 }, 16), -1);
});
