// A tablecloth that falls, in three.js.
import * as THREE from "three";
import { Cloth } from "selvedge";

const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 20);
camera.position.set(1.6, 1.6, 2);
const scene = new THREE.Scene();
scene.background = new THREE.Color("#ece8e1");
scene.add(new THREE.HemisphereLight("#fff", "#776", 2));
const sun = new THREE.DirectionalLight("#fff", 2);
sun.position.set(1, 3, 2);
scene.add(sun);

function mesh(points, faces, color) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(points), 3));
  geometry.setIndex(new THREE.BufferAttribute(faces, 1));
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color, side: THREE.DoubleSide }));
}

const cloth = await Cloth.load("tablecloth");
const sheet = mesh(cloth.positions, cloth.faces, "#b3542e");
scene.add(sheet, mesh(cloth.bodyPoints(), cloth.bodyFaces, "#8a8f98"));
sheet.geometry.computeBoundingSphere();
camera.lookAt(sheet.geometry.boundingSphere.center);

renderer.setAnimationLoop(() => {
  cloth.step();
  const position = sheet.geometry.getAttribute("position");
  position.array.set(cloth.positions);
  position.needsUpdate = true;
  sheet.geometry.computeVertexNormals();
  renderer.render(scene, camera);
});
