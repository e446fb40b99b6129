// Opens a .glb export in three.js, plays it, and compares vertices with those of the trajectory.
//
//     npm install three
//     node check_glb.mjs out/rollout.safetensors exports/cloth.glb 0 1
//
// The numbers are the first exported frame and every how many frames one was exported. Every
// twentieth exported frame is compared. Exits with 1 if a vertex is farther than 1e-6 m from where
// it should be.

import { readFileSync } from "node:fs";

// The loader is written for browsers.
globalThis.self = globalThis;
const { AnimationMixer, REVISION, Vector3 } = await import("three");
const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");

const [trajectory, glb, first, every] = process.argv.slice(2);

// A trajectory: a length, a JSON header, raw little-endian arrays.
const data = readFileSync(trajectory);
const length = Number(data.readBigUInt64LE(0));
const header = JSON.parse(data.subarray(8, 8 + length));
const rate = Number(header.__metadata__.fps);
const [frames, vertices] = header.positions.shape;
const start = data.byteOffset + 8 + length + header.positions.data_offsets[0];
const ours = new Float32Array(data.buffer.slice(start, start + 12 * frames * vertices));

const file = readFileSync(glb);
const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.length);
const gltf = await new GLTFLoader().parseAsync(bytes, "");
const [clip] = gltf.animations;
const mixer = new AnimationMixer(gltf.scene);
mixer.clipAction(clip).play();
const mesh = gltf.scene.getObjectByName("sheet");

const point = new Vector3();
let worst = 0;
let compared = 0;
for (let frame = Number(first); frame < frames; frame += 20 * Number(every)) {
  // At its very end a clip that repeats is at its beginning again.
  mixer.setTime(Math.min((frame - Number(first)) / rate, clip.duration - 1e-6));
  gltf.scene.updateMatrixWorld(true);
  for (let vertex = 0; vertex < vertices; vertex++) {
    mesh.getVertexPosition(vertex, point).applyMatrix4(mesh.matrixWorld);
    point.toArray().forEach((value, axis) => {
      worst = Math.max(worst, Math.abs(value - ours[3 * (frame * vertices + vertex) + axis]));
    });
  }
  compared++;
}
console.log(`three.js ${REVISION}: ${compared} frames of ${vertices} vertices, ${clip.duration} s, ${worst.toExponential(2)} m`);
process.exit(worst <= 1e-6 ? 0 : 1);
