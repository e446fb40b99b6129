// The bodies beside the cloth: obstacles that are drawn, taken hold of and led. A level plane is
// the floor of the room, and is not drawn itself.

import * as three from "three";
import type { Body } from "./protocol";

const FLOOR = 1;
const BALL = 2;

/** A ball that is not in play stands this far away at least, m. */
const AWAY = 100;

/** Farther back than the cloth that lies on it, by more than its offset: a gap is a millimetre. */
const BEHIND = { polygonOffset: true, polygonOffsetFactor: 4, polygonOffsetUnits: 8 };

interface RayHit {
  body: number;
  point: three.Vector3;
  distance: number;
}

interface Drawn {
  mesh: three.Mesh;
  faces: Uint32Array;
  /** The point of each one that is drawn, once it is placed. */
  pointOf: number[] | null;
  /** Its first point among those of all bodies. */
  first: number;
  points: number;
  kind: number;
}

export class BodyObjects {
  readonly group = new three.Group();
  private drawn: Drawn[] = [];
  private points: Float32Array = new Float32Array();
  private isPlaced = false;
  private readonly material = new three.MeshStandardMaterial({ roughness: 0.9, ...BEHIND });
  private readonly ballMaterial = new three.MeshStandardMaterial({ color: "#c0503f", roughness: 0.6, ...BEHIND });

  /** Other bodies; their places are to come. */
  set(bodies: Body[]): void {
    this.drawn.forEach(({ mesh }) => {
      this.group.remove(mesh);
      mesh.geometry.dispose();
    });
    this.isPlaced = false;
    let first = 0;
    this.drawn = bodies.map((body) => {
      const mesh = new three.Mesh(new three.BufferGeometry(), body.kind === BALL ? this.ballMaterial : this.material);
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      mesh.visible = false;
      this.group.add(mesh);
      const drawn = { mesh, faces: body.faces.slice(), pointOf: null, first, points: body.points, kind: body.kind };
      first += body.points;
      return drawn;
    });
    this.points = new Float32Array(3 * first);
  }

  look(colour: string): void {
    this.material.color.set(colour);
  }

  /** Puts the points of all bodies at `points`, [points, 3], m. */
  place(points: Float32Array): void {
    if (points.length !== this.points.length) return;
    for (const drawn of this.drawn) {
      const { mesh, first, points: count, kind } = drawn;
      const own = points.subarray(3 * first, 3 * (first + count));
      const before = this.points.subarray(3 * first, 3 * (first + count));
      if (this.isPlaced && own.every((x, k) => x === before[k])) continue;
      drawn.pointOf ??= split(mesh.geometry, own, drawn.faces);
      const position = mesh.geometry.getAttribute("position") as three.BufferAttribute;
      drawn.pointOf.forEach((point, k) => position.setXYZ(k, own[3 * point]!, own[3 * point + 1]!, own[3 * point + 2]!));
      position.needsUpdate = true;
      mesh.geometry.computeVertexNormals();
      mesh.geometry.boundingSphere = null;
      if (kind !== FLOOR) mesh.visible = Math.abs(own[1] ?? 0) < AWAY;
    }
    this.points.set(points);
    this.isPlaced = true;
  }

  /** The height of the floor, m; none without one. */
  get floor(): number | null {
    const floor = this.drawn.find(({ kind }) => kind === FLOOR);
    return floor ? this.points[3 * floor.first + 1]! : null;
  }

  /** The middle of a body now, m. */
  middle(body: number): three.Vector3 {
    const { first, points } = this.drawn[body]!;
    return middle(this.points.subarray(3 * first, 3 * (first + points)));
  }

  /** The number of the ball; none without one. */
  get ball(): number | null {
    const found = this.drawn.findIndex(({ kind }) => kind === BALL);
    return found < 0 ? null : found;
  }

  /** Adds what is drawn and moves with the cloth to `box`. */
  around(box: three.Box3): void {
    for (const { mesh, kind } of this.drawn) {
      if (kind === FLOOR || !mesh.visible) continue;
      mesh.geometry.computeBoundingBox();
      box.union(mesh.geometry.boundingBox!);
    }
  }

  /** The body that a ray meets first, and where. */
  hit(ray: three.Raycaster): RayHit | null {
    let best: RayHit | null = null;
    for (const [body, { mesh, kind }] of this.drawn.entries()) {
      if (kind === FLOOR || !mesh.visible) continue;
      const hit = ray.intersectObject(mesh, false)[0];
      if (hit && hit.distance < (best?.distance ?? Infinity)) best = { body, point: hit.point, distance: hit.distance };
    }
    return best;
  }
}

function middle(points: Float32Array): three.Vector3 {
  const sum = new three.Vector3();
  for (let k = 0; k < points.length; k += 3) sum.add(new three.Vector3(points[k], points[k + 1], points[k + 2]));
  return sum.divideScalar(Math.max(points.length / 3, 1));
}

/** Faces that meet at less than 50° are round. */
const ROUND = Math.cos((50 * Math.PI) / 180);

/** Makes the geometry of a body, in which a point on a sharp edge is drawn once for each side: the point of each one
 * that is drawn. */
function split(geometry: three.BufferGeometry, points: Float32Array, faces: Uint32Array): number[] {
  const at = (corner: number) => new three.Vector3().fromArray(points, 3 * faces[corner]!);
  const normals: three.Vector3[] = [];
  const around: number[][] = Array.from({ length: points.length / 3 }, () => []);
  for (let corner = 0; corner < faces.length; corner++) {
    around[faces[corner]!]!.push(corner);
    if (corner % 3 === 0) normals.push(at(corner + 1).sub(at(corner)).cross(at(corner + 2).sub(at(corner))).normalize());
  }
  const face = (corner: number) => Math.floor(corner / 3);
  const ends = (corner: number) => [0, 1, 2].map((k) => faces[3 * face(corner) + k]!);
  const index = new Uint32Array(faces.length);
  const pointOf: number[] = [];
  around.forEach((corners, point) => {
    // Sides: corners whose faces join over edges that are not sharp.
    const rest = new Set(corners);
    for (const begin of corners) {
      if (!rest.delete(begin)) continue;
      const side = [begin];
      for (const one of side) {
        for (const other of rest) {
          const joined = ends(one).filter((end) => ends(other).includes(end)).length > 1;
          if (joined && normals[face(one)]!.dot(normals[face(other)]!) > ROUND) rest.delete(other), side.push(other);
        }
      }
      side.forEach((corner) => (index[corner] = pointOf.length));
      pointOf.push(point);
    }
  });
  const position = new three.BufferAttribute(new Float32Array(3 * pointOf.length), 3);
  position.setUsage(three.DynamicDrawUsage);
  geometry.setAttribute("position", position);
  geometry.setIndex(new three.BufferAttribute(index, 1));
  return pointOf;
}
