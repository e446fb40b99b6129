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
      const geometry = new three.BufferGeometry();
      const position = new three.BufferAttribute(new Float32Array(3 * body.points), 3);
      position.setUsage(three.DynamicDrawUsage);
      geometry.setAttribute("position", position);
      geometry.setIndex(new three.BufferAttribute(body.faces.slice(), 1));
      const mesh = new three.Mesh(geometry, body.kind === BALL ? this.ballMaterial : this.material);
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      mesh.visible = body.kind !== FLOOR;
      this.group.add(mesh);
      const drawn = { mesh, first, points: body.points, kind: body.kind };
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
    for (const { mesh, first, points: count, kind } of this.drawn) {
      const own = points.subarray(3 * first, 3 * (first + count));
      const before = this.points.subarray(3 * first, 3 * (first + count));
      if (this.isPlaced && own.every((x, k) => x === before[k])) continue;
      const position = mesh.geometry.getAttribute("position") as three.BufferAttribute;
      (position.array as Float32Array).set(own);
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
