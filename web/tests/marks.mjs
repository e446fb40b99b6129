// The marks of handles without a browser: however many there are, each has its knob, and the
// buffers are made anew only when they are full.
import assert from "node:assert/strict";
import { test } from "node:test";
import { build } from "esbuild";

const bundled = await build({
  stdin: {
    contents: 'export { HandleMarks } from "./src/handles"; export { Vector3 } from "three";',
    resolveDir: process.cwd(),
    loader: "ts",
  },
  bundle: true,
  format: "esm",
  write: false,
});
const { HandleMarks, Vector3 } = await import(
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
