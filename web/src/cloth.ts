// One cloth as it is drawn: a two-sided, softly shaded surface, its edges, and its colours.

import * as three from "three";
import type { Cloth } from "./protocol";
import type { Edges } from "./colours";
import type { Look } from "./theme";

/** The textures that all cloths share. */
export interface Shared {
  map: three.DataTexture;
  weave: three.Texture;
}

/** A fine weave: the slope of crossing threads, as a normal map. */
export function weave(): three.Texture {
  const size = 64;
  const data = new Uint8Array(4 * size * size);
  for (let y = 0; y < size; y++) {
    for (let x = 0; x < size; x++) {
      const u = (x / size) * 8;
      const v = (y / size) * 8;
      const over = (Math.floor(u) + Math.floor(v)) % 2 === 0;
      const slope = 0.32 * Math.cos(Math.PI * ((over ? v : u) % 1));
      const nx = over ? 0 : slope;
      const ny = over ? slope : 0;
      const at = 4 * (y * size + x);
      data[at] = Math.round(127.5 + 127.5 * nx);
      data[at + 1] = Math.round(127.5 + 127.5 * ny);
      data[at + 2] = Math.round(127.5 + 127.5 * Math.sqrt(1 - slope * slope));
      data[at + 3] = 255;
    }
  }
  const texture = new three.DataTexture(data, size, size, three.RGBAFormat);
  texture.wrapS = texture.wrapT = three.RepeatWrapping;
  texture.magFilter = three.LinearFilter;
  texture.minFilter = three.LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.anisotropy = 4;
  texture.needsUpdate = true;
  return texture;
}

export class ClothObject {
  readonly group = new three.Group();
  readonly surface: three.Mesh;
  readonly field: Float32Array;
  private readonly geometry = new three.BufferGeometry();
  private readonly material: three.MeshPhysicalMaterial;
  private readonly lines: three.LineSegments;
  private readonly uniforms: Record<string, three.IUniform>;
  /** Vertex of each point that is drawn: a vertex on a seam is drawn once per panel. */
  readonly vertexOf: Uint32Array;
  /** Sums of the normals, [vertices, 3]. */
  private readonly sums: Float32Array;

  constructor(
    private readonly cloth: Cloth,
    edges: Edges,
    shared: Shared,
  ) {
    const points = cloth.material.length / 2;
    this.vertexOf = new Uint32Array(points);
    cloth.corners.forEach((point, corner) => (this.vertexOf[point] = cloth.faces[corner]!));
    this.sums = new Float32Array(3 * cloth.vertices);
    const dynamic = (width: number) => {
      const attribute = new three.BufferAttribute(new Float32Array(width * points), width);
      attribute.setUsage(three.DynamicDrawUsage);
      return attribute;
    };
    this.geometry.setAttribute("position", dynamic(3));
    this.geometry.setAttribute("normal", dynamic(3));
    this.field = new Float32Array(cloth.vertices);
    this.geometry.setAttribute("field", dynamic(1));
    // One repeat of the weave per 4 cm.
    const uv = Float32Array.from(cloth.material, (metres) => metres * 25);
    this.geometry.setAttribute("uv", new three.BufferAttribute(uv, 2));
    this.geometry.setIndex(new three.BufferAttribute(cloth.corners.slice(), 1));
    this.uniforms = {
      backColour: { value: new three.Color() },
      fieldMap: { value: shared.map },
      fieldMost: { value: 1 },
      fieldShown: { value: 0 },
    };
    this.material = this.fabric(shared);
    this.surface = new three.Mesh(this.geometry, this.material);
    this.surface.castShadow = true;
    this.surface.receiveShadow = true;
    this.surface.frustumCulled = false;
    this.lines = this.wires(edges);
    this.group.add(this.surface, this.lines);
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
    this.lines.geometry.dispose();
    (this.lines.material as three.Material).dispose();
  }

  /** Puts the vertices at `positions`, [vertices, 3], m. */
  place(positions: Float32Array): void {
    const position = this.geometry.getAttribute("position") as three.BufferAttribute;
    this.spread(positions, position.array as Float32Array);
    position.needsUpdate = true;
    this.normals(positions);
  }

  /** Colours by the field, with the brightest colour at `most`; null for plain cloth. */
  colour(most: number | null): void {
    this.uniforms.fieldShown!.value = most === null ? 0 : 1;
    if (most !== null) {
      this.uniforms.fieldMost!.value = most;
      const field = this.geometry.getAttribute("field") as three.BufferAttribute;
      const array = field.array as Float32Array;
      this.vertexOf.forEach((vertex, point) => (array[point] = this.field[vertex]!));
      field.needsUpdate = true;
    }
  }

  /** Gives every point the three numbers of its vertex. */
  private spread(from: Float32Array, to: Float32Array): void {
    const vertexOf = this.vertexOf;
    to.set(from);
    // The first points are those of the vertices themselves.
    for (let point = this.cloth.vertices; point < vertexOf.length; point++) {
      const vertex = 3 * vertexOf[point]!;
      to.set(from.subarray(vertex, vertex + 3), 3 * point);
    }
  }

  look(look: Look, edges: boolean, lines: three.Color): void {
    this.material.color.copy(look.front);
    this.material.sheenColor.copy(look.front).lerp(new three.Color(1, 1, 1), 0.5);
    (this.uniforms.backColour!.value as three.Color).copy(look.back);
    this.lines.visible = edges;
    (this.lines.material as three.LineBasicMaterial).color.copy(lines);
    // A little behind its lines. Without lines there is no offset: it grows with the slope, and pushes
    // the front of a fold at its horizon behind the back of what is beyond.
    this.material.polygonOffset = edges;
  }

  /** Leaves out what costs most, the higher the level. */
  simplify(level: number): void {
    this.material.sheen = level >= 1 ? 0 : 0.5;
    this.material.normalMap = level >= 2 ? null : this.material.normalMap;
    this.surface.receiveShadow = level < 2;
    this.material.needsUpdate = true;
  }

  private normals(positions: Float32Array): void {
    const attribute = this.geometry.getAttribute("normal") as three.BufferAttribute;
    const normals = this.sums;
    normals.fill(0);
    const faces = this.cloth.faces;
    for (let face = 0; face < faces.length; face += 3) {
      const a = 3 * faces[face]!, b = 3 * faces[face + 1]!, c = 3 * faces[face + 2]!;
      const ux = positions[b]! - positions[a]!, uy = positions[b + 1]! - positions[a + 1]!, uz = positions[b + 2]! - positions[a + 2]!;
      const vx = positions[c]! - positions[a]!, vy = positions[c + 1]! - positions[a + 1]!, vz = positions[c + 2]! - positions[a + 2]!;
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      for (const vertex of [a, b, c]) {
        normals[vertex]! += x;
        normals[vertex + 1]! += y;
        normals[vertex + 2]! += z;
      }
    }
    for (let k = 0; k < normals.length; k += 3) {
      const length = Math.sqrt(normals[k]! ** 2 + normals[k + 1]! ** 2 + normals[k + 2]! ** 2) || 1;
      normals[k]! /= length;
      normals[k + 1]! /= length;
      normals[k + 2]! /= length;
    }
    this.spread(normals, attribute.array as Float32Array);
    attribute.needsUpdate = true;
  }

  private fabric(shared: Shared): three.MeshPhysicalMaterial {
    const material = new three.MeshPhysicalMaterial({
      side: three.DoubleSide,
      shadowSide: three.DoubleSide,
      roughness: 0.82,
      metalness: 0,
      sheen: 0.5,
      sheenRoughness: 0.55,
      normalMap: shared.weave,
      normalScale: new three.Vector2(0.3, 0.3),
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.uniforms);
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nattribute float field;\nvarying float vField;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvField = field;");
      shader.fragmentShader = shader.fragmentShader
        .replace(
          "#include <common>",
          `#include <common>
          varying float vField;
          uniform vec3 backColour;
          uniform sampler2D fieldMap;
          uniform float fieldMost;
          uniform float fieldShown;`,
        )
        .replace(
          "#include <color_fragment>",
          `#include <color_fragment>
          if (fieldShown > 0.5) {
            diffuseColor.rgb = texture2D(fieldMap, vec2(clamp(vField / fieldMost, 0.0, 1.0), 0.5)).rgb;
          } else if (!gl_FrontFacing) {
            diffuseColor.rgb = backColour;
          }`,
        )
        .replace(
          "#include <emissivemap_fragment>",
          // A number must be read in the shade, too.
          "if (fieldShown > 0.5) totalEmissiveRadiance += 0.3 * diffuseColor.rgb;",
        );
    };
    return material;
  }

  private wires(edges: Edges): three.LineSegments {
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", this.geometry.getAttribute("position"));
    geometry.setIndex(new three.BufferAttribute(edges.ends, 1));
    const material = new three.LineBasicMaterial({ transparent: true, opacity: 0.35 });
    const lines = new three.LineSegments(geometry, material);
    lines.frustumCulled = false;
    lines.visible = false;
    return lines;
  }
}
