// Numbers per vertex to colour a cloth by, and the map from number to colour. The map is viridis
// (van der Walt and Smith, matplotlib 2015, CC0), as in the pictures of the command line.

import { DataTexture, LinearFilter, RGBAFormat, SRGBColorSpace } from "three";
import type { Cloth } from "./protocol";

export type Colouring = "plain" | "strain" | "speed" | "bending" | "difference" | "gap";

const VIRIDIS = [
  [68, 1, 84],
  [72, 40, 120],
  [62, 74, 137],
  [49, 104, 142],
  [38, 130, 142],
  [31, 158, 137],
  [53, 183, 121],
  [109, 205, 89],
  [180, 222, 44],
  [253, 231, 37],
] as const;

export interface Scale {
  title: string;
  unit: string;
  /** The value of the full colour, in the unit. */
  most: number;
  /** The unit in SI. */
  factor: number;
}

export const SCALES: Record<Exclude<Colouring, "plain">, Scale> = {
  strain: { title: "Strain of the edges", unit: "%", most: 30, factor: 0.01 },
  speed: { title: "Speed", unit: "m/s", most: 2.5, factor: 1 },
  bending: { title: "Bending", unit: "°", most: 45, factor: Math.PI / 180 },
  gap: { title: "Gap to other surfaces", unit: "mm", most: 5, factor: 0.001 },
  difference: { title: "Distance between the two", unit: "mm", most: 100, factor: 0.001 },
};

export function gradient(): string {
  return `linear-gradient(90deg, ${VIRIDIS.map((c) => `rgb(${c.join(" ")})`).join(", ")})`;
}

export function colourMap(): DataTexture {
  const size = 256;
  const data = new Uint8Array(4 * size);
  for (let k = 0; k < size; k++) {
    const place = (k / (size - 1)) * (VIRIDIS.length - 1);
    const before = Math.min(Math.floor(place), VIRIDIS.length - 2);
    const share = place - before;
    for (let c = 0; c < 3; c++) {
      data[4 * k + c] = Math.round(VIRIDIS[before]![c]! * (1 - share) + VIRIDIS[before + 1]![c]! * share);
    }
    data[4 * k + 3] = 255;
  }
  const texture = new DataTexture(data, size, 1, RGBAFormat);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The edges of a cloth, with what is measured along them. */
export class Edges {
  /** [edges, 2] */
  readonly ends: Uint32Array;
  /** [edges, 2]: vertices across, in the face on either side; the same twice on the boundary. */
  private readonly across: Uint32Array;
  /** Material length of each, m. */
  private readonly lengths: Float32Array;
  private readonly counts: Float32Array;

  constructor(cloth: Cloth) {
    const found = new Map<number, [number, number, number, number, number]>();
    const faces = cloth.faces;
    const m = cloth.material;
    const length = (p: number, q: number) => Math.hypot(m[2 * p]! - m[2 * q]!, m[2 * p + 1]! - m[2 * q + 1]!);
    for (let face = 0; face < faces.length; face += 3) {
      for (let k = 0; k < 3; k++) {
        const a = faces[face + k]!;
        const b = faces[face + ((k + 1) % 3)]!;
        const c = faces[face + ((k + 2) % 3)]!;
        const key = Math.min(a, b) * cloth.vertices + Math.max(a, b);
        const known = found.get(key);
        const own = length(cloth.corners[face + k]!, cloth.corners[face + ((k + 1) % 3)]!);
        if (known) {
          known[3] = c;
          // The two sides of a seam may differ.
          known[4] = 0.5 * (known[4] + own);
        } else {
          found.set(key, [a, b, c, c, own]);
        }
      }
    }
    const count = found.size;
    this.ends = new Uint32Array(2 * count);
    this.across = new Uint32Array(2 * count);
    this.lengths = new Float32Array(count);
    this.counts = new Float32Array(cloth.vertices);
    let edge = 0;
    for (const [a, b, c, d, own] of found.values()) {
      this.ends.set([a, b], 2 * edge);
      this.across.set([c, d], 2 * edge);
      this.lengths[edge] = own;
      if (c !== d) {
        this.counts[a]! += 1;
        this.counts[b]! += 1;
      }
      edge += 1;
    }
  }

  /** The largest strain of the edges at each vertex. */
  strain(positions: Float32Array, to: Float32Array): void {
    to.fill(0);
    const { ends, lengths } = this;
    for (let edge = 0; edge < lengths.length; edge++) {
      const a = ends[2 * edge]!;
      const b = ends[2 * edge + 1]!;
      const strain = distance(positions, a, b) / lengths[edge]! - 1;
      if (strain > to[a]!) to[a] = strain;
      if (strain > to[b]!) to[b] = strain;
    }
  }

  /** The mean size of the dihedral angles of the edges at each vertex, rad. */
  bending(positions: Float32Array, to: Float32Array): void {
    to.fill(0);
    const { ends, across, counts } = this;
    for (let edge = 0; edge < ends.length / 2; edge++) {
      const c = across[2 * edge]!;
      const d = across[2 * edge + 1]!;
      if (c === d) continue;
      const a = ends[2 * edge]!;
      const b = ends[2 * edge + 1]!;
      const angle = foldAngle(positions, a, b, c, d);
      to[a]! += angle;
      to[b]! += angle;
    }
    for (let vertex = 0; vertex < to.length; vertex++) {
      to[vertex]! /= Math.max(counts[vertex]!, 1);
    }
  }
}

function distance(p: Float32Array, a: number, b: number): number {
  const x = p[3 * a]! - p[3 * b]!;
  const y = p[3 * a + 1]! - p[3 * b + 1]!;
  const z = p[3 * a + 2]! - p[3 * b + 2]!;
  return Math.sqrt(x * x + y * y + z * z);
}

/** The size of the angle between the faces (a, b, c) and (b, a, d). */
function foldAngle(p: Float32Array, a: number, b: number, c: number, d: number): number {
  const ux = p[3 * b]! - p[3 * a]!, uy = p[3 * b + 1]! - p[3 * a + 1]!, uz = p[3 * b + 2]! - p[3 * a + 2]!;
  const vx = p[3 * c]! - p[3 * a]!, vy = p[3 * c + 1]! - p[3 * a + 1]!, vz = p[3 * c + 2]! - p[3 * a + 2]!;
  const wx = p[3 * d]! - p[3 * a]!, wy = p[3 * d + 1]! - p[3 * a + 1]!, wz = p[3 * d + 2]! - p[3 * a + 2]!;
  const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  const mx = wy * uz - wz * uy, my = wz * ux - wx * uz, mz = wx * uy - wy * ux;
  const cx = ny * mz - nz * my, cy = nz * mx - nx * mz, cz = nx * my - ny * mx;
  return Math.atan2(Math.sqrt(cx * cx + cy * cy + cz * cz), nx * mx + ny * my + nz * mz);
}

/** Writes the speed of each vertex between two frames, m/s. */
export function speed(now: Float32Array, before: Float32Array, seconds: number, to: Float32Array): void {
  for (let vertex = 0; vertex < to.length; vertex++) {
    to[vertex] = apart(now, before, vertex) / seconds;
  }
}

/** Writes the distance of each vertex from the same vertex of another cloth, m. */
export function difference(one: Float32Array, other: Float32Array, to: Float32Array): void {
  for (let vertex = 0; vertex < to.length; vertex++) {
    to[vertex] = apart(one, other, vertex);
  }
}

function apart(one: Float32Array, other: Float32Array, vertex: number): number {
  const x = one[3 * vertex]! - other[3 * vertex]!;
  const y = one[3 * vertex + 1]! - other[3 * vertex + 1]!;
  const z = one[3 * vertex + 2]! - other[3 * vertex + 2]!;
  return Math.sqrt(x * x + y * y + z * z);
}
