// A cape on a skinned character that walks, turns and is set elsewhere, in three.js.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Cloth, Worn } from "selvedge";

const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
renderer.shadowMap.enabled = true;
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 30);
const scene = new THREE.Scene();
scene.background = new THREE.Color("#ece8e1");
scene.add(new THREE.HemisphereLight("#fff", "#776", 2));
const sun = new THREE.DirectionalLight("#fff", 2.5);
sun.castShadow = true;
sun.shadow.mapSize.set(2048, 2048);
sun.shadow.bias = -0.002;
Object.assign(sun.shadow.camera, { left: -1.5, right: 1.5, top: 1.5, bottom: -1.5, near: 1, far: 8 });
const floor = new THREE.Mesh(new THREE.PlaneGeometry(60, 60), new THREE.MeshStandardMaterial({ color: "#d9d3c7" }));
floor.rotation.x = -Math.PI / 2;
floor.receiveShadow = true;
scene.add(sun, sun.target, floor);

// The character, in the pose in which it was modelled.
const { scene: character, animations } = await new GLTFLoader().loadAsync("mannequin.glb");
character.traverse((part) => {
  part.castShadow = true;
  // The file has no normals.
  part.geometry?.computeVertexNormals();
  if (part.material) part.material.flatShading = false;
});
scene.add(character);
character.updateWorldMatrix(true, true);
// three.js writes names of bones without spaces.
const bone = (name) => character.getObjectByName(name.replaceAll(" ", "_"));

// The cape: held by the chest, pushed by five bones.
const cloth = await Cloth.load(await (await fetch("cape.toml")).text());
const worn = new Worn(cloth, bone("chest"), ["chest", "left thigh", "right thigh", "left shin", "right shin"].map(bone));
const geometry = new THREE.BufferGeometry();
geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(cloth.positions), 3));
geometry.setIndex(new THREE.BufferAttribute(cloth.faces, 1));
const cape = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color: "#8c2f39", roughness: 0.9, side: THREE.DoubleSide }));
cape.castShadow = cape.receiveShadow = true;
cape.frustumCulled = false;
scene.add(cape);

const mixer = new THREE.AnimationMixer(character);
const walk = mixer.clipAction(animations.find((clip) => clip.name === "walk"));
walk.play();

// For tests: milliseconds of the cloth in each frame, jumps, and what went wrong.
const report = (globalThis.report = { times: [], frames: 0, jumps: 0, problems: [] });
let [last, way, side] = [performance.now(), 0, 1];

function move(seconds) {
  mixer.update(seconds);
  way += seconds;
  // Into the clip's walk on the spot comes a way: a wide circle, and every 4 s a leap to its other side.
  if (way > 4) [way, side, report.jumps] = [0, -side, report.jumps + 1];
  const angle = 0.5 * way + (side < 0 ? Math.PI : 0);
  character.position.set(2 * Math.sin(angle), 0, 2 * Math.cos(angle));
  character.rotation.y = angle + Math.PI / 2;
  character.updateWorldMatrix(true, true);
  const began = performance.now();
  try {
    report.frames += worn.update(seconds);
  } catch (error) {
    report.problems.push(String(error));
  }
  report.times.push(performance.now() - began);
  geometry.getAttribute("position").array.set(cloth.positions);
  geometry.getAttribute("position").needsUpdate = true;
  geometry.computeVertexNormals();
}

function draw() {
  const { x, z } = character.position;
  sun.position.set(x + 1.5, 4, z + 1);
  sun.target.position.set(x, 0, z);
  camera.position.set(x - 2.6 * Math.sin(character.rotation.y - 0.5), 1.7, z - 2.6 * Math.cos(character.rotation.y - 0.5));
  camera.lookAt(x, 0.95, z);
  renderer.render(scene, camera);
}

report.move = (seconds, isDrawn = true) => (move(seconds), isDrawn && draw());
report.positions = () => Array.from(cloth.positions);
draw();
// The engine compiles the solver in the first frames, which are slow, as it does the shaders of the first picture.
for (let k = 0; k < 30; k++) worn.update(1 / cloth.frameRate);
cloth.reset();
last = performance.now();
if (location.hash !== "#still") {
  renderer.setAnimationLoop((now) => {
    move((now - last) / 1000);
    last = now;
    draw();
  });
}
report.ready = true;
