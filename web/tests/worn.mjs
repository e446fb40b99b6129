// What a character wears: where a worn cloth of the npm package sends handles and bodies, without a
// browser and without WebAssembly: npm run check.
import assert from "node:assert/strict";
import { test } from "node:test";
import { build } from "esbuild";
import * as THREE from "three";

const stub = {
  name: "without-module",
  setup(build) {
    build.onResolve({ filter: /selvedge_web/ }, () => ({ path: "stub", namespace: "stub" }));
    build.onLoad({ filter: /.*/, namespace: "stub" }, () => ({ contents: "export default 0; export class Cloth {}" }));
  },
};
const { outputFiles } = await build({ entryPoints: ["npm/index.ts"], bundle: true, format: "esm", write: false, plugins: [stub] });
const { Worn } = await import(`data:text/javascript;base64,${Buffer.from(outputFiles[0].contents).toString("base64")}`);

/** A character of two bones, and a cloth that keeps what it is told. */
function worn(following) {
  const [chest, thigh] = [new THREE.Object3D(), new THREE.Object3D()];
  chest.position.set(0.1, 1, 0.2);
  chest.rotation.set(0.3, 1, -0.4);
  chest.scale.setScalar(0.01);
  thigh.position.set(0, -50, 0);
  thigh.rotation.set(1, 2, 3);
  chest.add(thigh);
  chest.updateWorldMatrix(true, true);
  const calls = [];
  const say = (name) => (...given) => calls.push([name, ...given]);
  const cloth = { handles: [0, 1], positions: new Float32Array([0, 1, 0, 0.5, 1, 0]), frameRate: 60 };
  for (const name of ["leadBody", "step", "teleport", "reset"]) cloth[name] = say(name);
  const rigid = (bone) => {
    const [place, turn] = [new THREE.Vector3(), new THREE.Quaternion()];
    bone.matrixWorld.decompose(place, turn, new THREE.Vector3());
    return new THREE.Matrix4().compose(place, turn, new THREE.Vector3(1, 1, 1));
  };
  const begin = [chest, thigh].map((bone) => rigid(bone).invert());
  const away = () => [chest, thigh].map((bone, k) => rigid(bone).multiply(begin[k]));
  return { chest, thigh, cloth, calls, away, worn: new Worn(cloth, chest, [thigh], following), move: () => chest.updateWorldMatrix(true, true) };
}

const apart = (found, expected) => Math.max(...found.map((x, k) => Math.abs(x - expected[k])));
const names = (calls) => calls.map(([name]) => name).join(" ");
const held = (cloth, matrix) =>
  [0, 1].flatMap((k) => new THREE.Vector3(...cloth.positions.slice(3 * k, 3 * k + 3)).applyMatrix4(matrix).toArray());

test("a frame leads bodies and handles where the bones have gone", () => {
  const one = worn();
  one.chest.position.x += 0.05;
  one.chest.rotation.y += 0.05;
  one.thigh.rotation.x += 0.1;
  one.move();
  assert.equal(one.worn.update(1 / 60), 1);
  assert.equal(names(one.calls), "leadBody step");
  const [anchor, body] = one.away();
  assert.ok(apart(one.calls[0][2], body.elements) < 1e-12);
  assert.ok(apart(one.calls[1][1], held(one.cloth, anchor)) < 1e-12);
});

test("a hitch is divided, and the cloth is set on by the time beyond four frames", () => {
  const one = worn();
  one.chest.position.x += 0.2;
  one.move();
  assert.equal(one.worn.update(4 / 60), 4);
  assert.equal(names(one.calls), "leadBody step ".repeat(4).trim());
  const ways = one.calls.filter(([name]) => name === "step").map(([, places]) => places[0]);
  assert.ok(apart(ways, [0.05, 0.1, 0.15, 0.2]) < 1e-12);
  assert.equal(one.worn.update(0.01), 0);
  // Half a second later, and as fast as before.
  one.chest.position.x += 1.5;
  one.move();
  one.calls.length = 0;
  assert.equal(one.worn.update(0.49), 4);
  assert.equal(names(one.calls), "teleport " + "leadBody step ".repeat(4).trim());
  assert.ok(apart(one.calls[0][1].slice(12), [1.3, 0, 0, 1]) < 1e-9);
  assert.equal(one.worn.update(0.01), 0);
});

test("a character that is set elsewhere takes the cloth along", () => {
  const one = worn();
  one.chest.position.set(5, 1, 3);
  one.chest.rotation.y += 2.5;
  one.move();
  assert.equal(one.worn.update(1 / 60), 1);
  assert.equal(names(one.calls), "teleport leadBody step");
  const [anchor, body] = one.away();
  assert.ok(apart(one.calls[0][1], anchor.elements) < 1e-12);
  assert.deepEqual([...one.calls[0][2]], [0]);
  assert.ok(apart(one.calls[1][2], body.elements) < 1e-12);
});

test("beyond a jump the handles go on as fast as before it", () => {
  const one = worn();
  const go = (x) => ((one.chest.position.x += x), one.move(), one.worn.update(1 / 60));
  go(0.02);
  go(4.02);
  const [teleport] = one.calls.filter(([name]) => name === "teleport");
  assert.ok(apart(teleport[1].slice(12), [4, 0, 0, 1]) < 1e-9, String(teleport[1]));
});

test("after a jump the bodies take a quarter of a second to their bones, beside the anchor", () => {
  const one = worn();
  one.chest.position.set(5, 1, 3);
  one.thigh.position.x += 15;
  one.move();
  const gaps = [];
  for (let k = 0; k < 15; k++) {
    one.chest.position.x += 0.02;
    one.move();
    one.worn.update(1 / 60);
    const [, led] = one.calls.filter(([name]) => name === "leadBody").at(-1).slice(1);
    gaps.push(apart(led, one.away()[1].elements));
  }
  assert.ok(gaps[0] > 0.05 && gaps.every((gap, k) => k === 0 || gap < gaps[k - 1]), String(gaps));
  assert.ok(gaps[14] < 1e-12);
});

test("what cannot be moved begins anew where the character stands, and is said", () => {
  const one = worn();
  one.cloth.step = () => {
    throw new Error("frame 1: too far");
  };
  one.chest.position.x += 0.1;
  one.move();
  assert.throws(() => one.worn.update(1 / 60), /too far/);
  assert.equal(names(one.calls), "leadBody reset teleport");
  assert.ok(apart(one.calls[2][1], one.away()[0].elements) < 1e-12);
});

test("a bone that is mirrored is followed as three.js has it", () => {
  const one = worn();
  one.chest.scale.set(-0.01, 0.01, 0.01);
  one.move();
  const mirrored = new Worn(one.cloth, one.chest, []);
  const rigid = () => {
    const [place, turn] = [new THREE.Vector3(), new THREE.Quaternion()];
    one.chest.matrixWorld.decompose(place, turn, new THREE.Vector3());
    return new THREE.Matrix4().compose(place, turn, new THREE.Vector3(1, 1, 1));
  };
  const begin = rigid().invert();
  one.chest.rotation.x += 0.05;
  one.move();
  mirrored.update(1 / 60);
  assert.ok(apart(one.calls.at(-1)[1], held(one.cloth, rigid().multiply(begin))) < 1e-6);
});

test("times, settings and places that cannot be are said, and the next frame goes on", () => {
  const one = worn();
  assert.throws(() => one.worn.update(NaN), /seconds: expected .* found NaN/);
  assert.throws(() => one.worn.update(), /seconds/);
  one.chest.scale.setScalar(0);
  one.move();
  assert.throws(() => one.worn.update(1 / 60), /matrixWorld: .* without a scale of 0/);
  one.chest.scale.setScalar(0.01);
  one.move();
  assert.equal(one.worn.update(1 / 60), 1);
  for (const mostFrames of [0, 0.5, NaN]) assert.throws(() => worn({ mostFrames }), /mostFrames: expected 1 or more/);
  for (const fastest of [0, -1, NaN]) assert.throws(() => worn({ fastest }), /fastest: expected a speed above 0/);
  assert.throws(() => worn({ mostframes: 4 }), /mostframes: there is no such option; there are mostFrames, fastest/);
});
