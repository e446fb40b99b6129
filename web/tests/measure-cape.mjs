// Times of the cape on a walking character, in Node: after npm run build:static, node tests/measure-cape.mjs
// [PACKAGE], with the package that is built or installed there.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { resolve } from "node:path";
import * as THREE from "three";

const found = process.argv[2] ?? "dist-npm";
const { Cloth, Worn } = await import(pathToFileURL(resolve(found, "index.js")));
const cloth = await Cloth.load(readFileSync(new URL("../npm/cape.toml", import.meta.url), "utf8"));
const character = new THREE.Object3D();
// Joints of torso, thighs and shins; a thigh is 0.41 m long.
const bones = [[0, 0.95], [0.1, 0.9], [-0.1, 0.9], [0.1, 0.49], [-0.1, 0.49]].map(([x, y]) => {
  const bone = new THREE.Object3D();
  bone.position.set(x, y, 0);
  character.add(bone);
  return bone;
});
const joints = bones.map((bone) => bone.position.clone());
character.updateWorldMatrix(true, true);
const worn = new Worn(cloth, bones[0], bones);

/** Walks along a circle of 2 m at 1.3 m/s, and leaps to its other side every 3.3 s. */
function walk(now) {
  const angle = 0.65 * now + (Math.floor(now / 3.3) % 2 ? 3 : 0);
  character.position.set(2 * Math.sin(angle), 0, 2 * Math.cos(angle));
  character.rotation.y = angle + Math.PI / 2;
  const swing = (phase) => Math.sin(5.5 * now + phase) * Math.min(now / 0.5, 1);
  bones.forEach((bone, k) => {
    const side = k % 2 ? 0 : Math.PI;
    bone.position.copy(joints[k]);
    bone.rotation.x = k === 0 ? 0.05 * swing(0) : k < 3 ? 0.45 * swing(side) : 0.3 * (Math.min(now / 0.5, 1) + swing(side + 1));
    const hip = 0.45 * swing(side);
    if (k > 2) bone.position.add(new THREE.Vector3(0, 0.41 * (1 - Math.cos(hip)), -0.41 * Math.sin(hip)));
  });
  character.updateWorldMatrix(true, true);
}

// As the page does: the engine compiles the solver in the first frames.
for (let k = 0; k < 10; k++) worn.update(1 / 60);
cloth.reset();
const times = [];
let now = 0;
for (let frame = 0; frame < 600; frame++) {
  // Hitches: a tenth of a second every hundred frames, and a second once.
  const seconds = frame === 350 ? 1 : frame % 100 === 50 ? 0.1 : 1 / 60;
  now += seconds;
  walk(now);
  const [began, used] = [performance.now(), process.cpuUsage()];
  worn.update(seconds);
  const { user, system } = process.cpuUsage(used);
  if (seconds < 0.02) times.push([performance.now() - began, (user + system) / 1000]);
}
for (const [k, of] of ["time", "processor time"].entries()) {
  const mine = times.map((one) => one[k]);
  const mean = mine.reduce((sum, one) => sum + one, 0) / mine.length;
  console.log(`${cloth.frame} frames of the cape: ${of} at most ${Math.max(...mine).toFixed(1)} ms, mean ${mean.toFixed(1)} ms`);
}
if (cloth.warnings) console.log(cloth.warnings);
