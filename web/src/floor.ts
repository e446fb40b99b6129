// The floor: a pool of light that fades into the room, with faint lines half a metre apart, by
// which one sees that the cloth moves on, and the shadow that falls on it.

import * as three from "three";
import type { Theme } from "./theme";

const RADIUS = 9;

export class Floor {
  readonly group = new three.Group();
  private readonly shadow = new three.ShadowMaterial({ opacity: 0.3, depthWrite: false });
  private readonly uniforms = {
    near: { value: new three.Color() },
    far: { value: new three.Color() },
    grid: { value: new three.Color() },
    at: { value: new three.Vector2() },
  };

  constructor() {
    const disc = new three.CircleGeometry(RADIUS, 72);
    disc.rotateX(-Math.PI / 2);
    const ground = new three.Mesh(disc, this.ground());
    ground.renderOrder = -2;
    const shade = new three.Mesh(disc, this.shadow);
    shade.position.y = 0.001;
    shade.renderOrder = -1;
    shade.receiveShadow = true;
    this.group.add(ground, shade);
  }

  look(theme: Theme): void {
    this.uniforms.near.value.set(theme.floor);
    this.uniforms.far.value.set(theme.background);
    this.uniforms.grid.value.set(theme.grid);
    this.shadow.opacity = theme.shadow;
  }

  /** The disc goes with the view; its lines stay where they are in the world. */
  at(center: three.Vector3): void {
    this.uniforms.at.value.set(center.x, center.z);
  }

  private ground(): three.ShaderMaterial {
    return new three.ShaderMaterial({
      uniforms: this.uniforms,
      depthWrite: false,
      toneMapped: false,
      vertexShader: `
        varying vec2 place;
        void main() {
          place = position.xz;
          gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
        }`,
      fragmentShader: `
        varying vec2 place;
        uniform vec3 near;
        uniform vec3 far;
        uniform vec3 grid;
        uniform vec2 at;
        void main() {
          float away = length(place) / ${RADIUS.toFixed(1)};
          float light = pow(1.0 - smoothstep(0.0, 1.0, away), 1.6);
          vec2 world = (place + at) * 2.0;
          vec2 width = fwidth(world) * 1.2;
          vec2 line = smoothstep(width, vec2(0.0), abs(fract(world - 0.5) - 0.5));
          // Lines closer than pixels are left out.
          float fine = 1.0 - smoothstep(0.15, 0.5, max(width.x, width.y));
          vec3 colour = mix(far, near, light);
          colour = mix(colour, grid, max(line.x, line.y) * 0.35 * light * fine);
          gl_FragColor = linearToOutputTexel(vec4(colour, 1.0));
        }`,
    });
  }
}
