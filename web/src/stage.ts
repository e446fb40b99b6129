// The room: light, floor, camera, the cloths in it and their handles.

import * as three from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { BodyObjects } from "./bodies";
import { ClothObject, weave, type Shared } from "./cloth";
import { Floor } from "./floor";
import { HandleMarks } from "./handles";
import { LEAST, Quality } from "./quality";
import { Edges, colourMap, difference, speed, type Colouring } from "./colours";
import { nearest } from "./places";
import type { Cloth, Frame } from "./protocol";
import { THEMES, type Theme } from "./theme";

export interface Hit {
  vertex: number;
  track: number;
  /** The place in the room. */
  point: three.Vector3;
  isHandle: boolean;
}

/** A body that is hit. */
export interface BodyHit {
  body: number;
  /** The place in the room. */
  point: three.Vector3;
}

export class Stage {
  readonly camera = new three.PerspectiveCamera(36, 1, 0.05, 60);
  readonly renderer: three.WebGLRenderer;
  readonly controls: OrbitControls;
  readonly selected = new Set<number>();
  edgesShown = false;
  handlesShown = true;
  colouring: Colouring = "plain";
  together = false;
  /** True where the view goes along with the cloth. */
  follows = true;
  /** True while a hand drags: the view then stays, or it would run away from the hand. */
  dragging = false;
  /** The last frame that was put in place. */
  frame: Frame | null = null;
  /** The value of the full colour, in SI; only the difference finds its own. */
  most = 1;

  private readonly scene = new three.Scene();
  private readonly sun = new three.DirectionalLight(0xfff4e6, 2.6);
  private readonly sky = new three.HemisphereLight(0xf3f6ff, 0xb5a794, 1.5);
  private readonly floor = new Floor();
  private readonly quality = new Quality(new URLSearchParams(location.search).has("full"));
  private readonly shared: Shared = { map: colourMap(), weave: weave() };
  private readonly marks = new HandleMarks();
  readonly bodies = new BodyObjects();
  private cloth: Cloth | null = null;
  private edges: Edges | null = null;
  private objects: ClothObject[] = [];
  private before: Frame | null = null;
  private theme: Theme = THEMES.light;
  private width = 1;
  private covered = { right: 0, bottom: 0 };
  private readonly center = new three.Vector3();
  private followed = performance.now();
  private fitted = false;
  private awaitsStart = false;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: false });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = three.VSMShadowMap;
    this.renderer.toneMapping = three.ACESFilmicToneMapping;
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    // Over a figure the wheel goes on with the text.
    this.controls.enableZoom = !document.body.classList.contains("figure");
    this.controls.dampingFactor = 0.12;
    this.controls.minDistance = 0.3;
    this.controls.maxDistance = 20;
    this.controls.maxPolarAngle = Math.PI * 0.62;
    // Arrows move the handles, not the camera.
    this.controls.keys = { LEFT: "", UP: "", RIGHT: "", BOTTOM: "" };
    this.light();
    this.scene.add(this.sun, this.sun.target, this.sky, this.floor.group, this.marks.group, this.bodies.group);
    this.setTheme("light");
    if (isSoftware(this.renderer.getContext()) && this.quality.begin(LEAST)) this.lower();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.resize();
  }

  setTheme(name: "light" | "dark"): void {
    this.theme = THEMES[name];
    this.scene.background = new three.Color(this.theme.background);
    this.floor.look(this.theme);
    this.renderer.toneMappingExposure = this.theme.exposure;
    this.marks.look(this.theme.handle);
    this.bodies.look(this.theme.body);
  }

  /** Another cloth; its frames are to come. */
  setCloth(cloth: Cloth): void {
    this.objects.forEach((object) => {
      this.scene.remove(object.group);
      object.dispose();
    });
    this.objects = [];
    this.selected.clear();
    this.cloth = cloth;
    this.edges = new Edges(cloth);
    this.bodies.set(cloth.bodies);
    this.frame = this.before = null;
    this.fitted = false;
  }

  /** The latest frame. */
  take(frame: Frame): void {
    if (!this.cloth || frame.generation !== this.cloth.generation) return;
    if (this.awaitsStart && this.frame && frame.time < this.frame.time) this.fitted = this.awaitsStart = false;
    this.before = this.frame && this.frame.number !== frame.number ? this.frame : this.before;
    this.frame = frame;
  }

  /** Puts everything where the latest frame has it, and draws. */
  draw(): void {
    // Before the drawing: a canvas of another size is empty.
    if (this.quality.next()) this.lower();
    this.controls.update();
    if (this.frame && this.cloth) {
      this.arrange(this.frame);
      if (!this.fitted) this.fit();
      else this.follow();
    }
    this.renderer.render(this.scene, this.camera);
  }

  /** The level of what is left out of the picture, from 0. */
  get level(): number {
    return this.quality.level;
  }

  get trackCount(): number {
    return this.objects.length;
  }

  /** The place of a track beside the others, m along z. */
  offset(track: number): number {
    if (this.together || this.objects.length < 2) return 0;
    return (track - (this.objects.length - 1) / 2) * -this.width;
  }

  /** The vertex under a point of the screen, in pixels; handles reach farther than cloth. */
  pick(x: number, y: number, reach: number): Hit | null {
    if (!this.frame) return null;
    const handle = this.pickHandle(x, y, reach);
    if (handle) return handle;
    const ray = this.ray(x, y);
    let best: Hit | null = null;
    let nearest = Infinity;
    this.objects.forEach((object, track) => {
      const surface = object.surface;
      surface.geometry.boundingSphere = null;
      const hit = ray.intersectObject(surface, false)[0];
      if (!hit?.face || hit.distance >= nearest) return;
      nearest = hit.distance;
      const corners = [hit.face.a, hit.face.b, hit.face.c].map((point) => object.vertexOf[point]!);
      const distances = corners.map((vertex) => this.point(track, vertex).distanceTo(hit.point));
      const vertex = corners[distances.indexOf(Math.min(...distances))]!;
      best = { vertex, track, point: this.point(track, vertex), isHandle: false };
    });
    return best ?? this.pickBeside(x, y, reach);
  }

  /** The body under a point of the screen, in pixels, where no handle and no cloth is before it. */
  pickBody(x: number, y: number): BodyHit | null {
    if (!this.frame) return null;
    const ray = this.ray(x, y);
    const hit = this.bodies.hit(ray);
    if (!hit) return null;
    for (const object of this.objects) {
      object.surface.geometry.boundingSphere = null;
      const cloth = ray.intersectObject(object.surface, false)[0];
      if (cloth && cloth.distance < hit.distance) return null;
    }
    return hit;
  }

  /** The ray from the eye through a point of the screen, in pixels. */
  ray(x: number, y: number): three.Raycaster {
    const ray = new three.Raycaster();
    const size = this.canvas.getBoundingClientRect();
    ray.setFromCamera(new three.Vector2((x / size.width) * 2 - 1, 1 - (y / size.height) * 2), this.camera);
    return ray;
  }

  /** The vertex nearest on the screen to a point beside the cloth: a corner is hard to hit. */
  private pickBeside(x: number, y: number, reach: number): Hit | null {
    const size = this.canvas.getBoundingClientRect();
    for (let track = 0; track < this.objects.length; track++) {
      const count = this.frame!.tracks[track]!.length / 3;
      const places = Array.from({ length: count }, (_, vertex) => this.within(size, this.point(track, vertex)));
      const vertex = nearest(places, { x, y }, reach);
      if (vertex >= 0) return { vertex, track, point: this.point(track, vertex), isHandle: false };
    }
    return null;
  }

  /** The place of a vertex of a track in the room. */
  point(track: number, vertex: number): three.Vector3 {
    const positions = this.frame!.tracks[track]!;
    return new three.Vector3(
      positions[3 * vertex],
      positions[3 * vertex + 1],
      positions[3 * vertex + 2]! + this.offset(track),
    );
  }

  /** The place of a point of the room on the screen, in pixels of the canvas. */
  onScreen(point: three.Vector3): { x: number; y: number } {
    return this.within(this.canvas.getBoundingClientRect(), point);
  }

  private within(size: DOMRect, point: three.Vector3): { x: number; y: number } {
    const at = point.clone().project(this.camera);
    return { x: ((at.x + 1) / 2) * size.width, y: ((1 - at.y) / 2) * size.height };
  }

  /** Looks at all of the cloth now, and again when it is back at its start. */
  fitAtStart(): void {
    this.awaitsStart = true;
    this.fit();
  }

  /** Looks at all of the cloth from in front and a little above. */
  fit(): void {
    const box = new three.Box3();
    this.objects.forEach((object, track) => {
      const positions = this.frame!.tracks[track]!;
      for (let k = 0; k < positions.length; k += 3) {
        box.expandByPoint(new three.Vector3(positions[k], positions[k + 1], positions[k + 2]! + this.offset(track)));
      }
      object.group.visible = true;
    });
    if (box.isEmpty()) return;
    this.bodies.around(box);
    const center = box.getCenter(new three.Vector3());
    const size = box.getSize(new three.Vector3());
    const vertical = Math.tan((this.camera.fov * Math.PI) / 360);
    const horizontal = vertical * this.camera.aspect;
    const distance = 1.62 * Math.max((size.y / 2 + 0.08) / vertical, (size.z / 2 + 0.1) / horizontal) + size.x / 2;
    // What lies on a body is seen from above.
    const above = this.bodies.floor === null ? 0.16 : 0.38;
    const direction = new three.Vector3(1, above, this.objects.length > 1 ? 0.12 : 0.42).normalize();
    this.controls.target.copy(center).add(new three.Vector3(0, -0.02 * size.y, 0));
    this.camera.position.copy(this.controls.target).addScaledVector(direction, distance);
    const below = box.min.y - 0.3 * Math.max(size.y, 0.5);
    this.floor.group.position.set(center.x, this.bodies.floor ?? below, center.z);
    this.center.copy(this.handleCenter());
    this.shine(center);
    const reach = Math.max(size.z, size.y, 1) * 1.5 + 0.8;
    Object.assign(this.sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
    this.sun.shadow.camera.updateProjectionMatrix();
    this.controls.update();
    this.fitted = true;
  }

  /** Has the light fall on `center`. */
  private shine(center: three.Vector3): void {
    this.sun.position.copy(center).add(new three.Vector3(2.5, 3.4, 1.5));
    this.sun.target.position.copy(center);
  }

  /** Takes the view along with the handles, gently. */
  private follow(): void {
    const now = performance.now();
    const seconds = Math.min((now - this.followed) / 1000, 0.5);
    this.followed = now;
    if (!this.follows || this.dragging) return;
    const away = this.handleCenter().sub(this.center);
    // Cloth that falls, or was thrown, is let go.
    if (away.length() > 50) return;
    const step = away.multiplyScalar(1 - Math.exp(-3 * seconds));
    this.center.add(step);
    this.controls.target.add(step);
    this.camera.position.add(step);
    this.shine(this.sun.target.position.clone().add(step));
    this.floor.group.position.x = this.center.x;
    this.floor.group.position.z = this.center.z;
    this.floor.at(this.center);
  }

  private handleCenter(): three.Vector3 {
    const center = new three.Vector3();
    const goals = this.frame?.goals ?? [];
    for (const { vertex } of goals) center.add(this.point(0, vertex));
    if (goals.length === 0) return this.center.clone();
    center.divideScalar(goals.length);
    center.z -= this.offset(0);
    return center;
  }

  /** Leaves something out, so that drawing keeps up on this machine. */
  private lower(): void {
    const level = this.quality.level;
    const size = level >= 2 ? 256 : 512;
    this.sun.shadow.mapSize.set(size, size);
    this.sun.shadow.blurSamples = level >= 2 ? 6 : 10;
    this.sun.shadow.radius = level >= 2 ? 3 : 6;
    this.sun.shadow.map?.dispose();
    this.sun.shadow.map = null;
    this.sun.castShadow = level < LEAST;
    this.objects.forEach((object) => object.simplify(level));
    this.resize(false);
  }

  private light(): void {
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.radius = 12;
    this.sun.shadow.blurSamples = 20;
    this.sun.shadow.bias = -0.0006;
    this.sun.shadow.camera.near = 0.1;
    this.sun.shadow.camera.far = 14;
    const rim = new three.DirectionalLight(0xcfe0ff, 0.7);
    rim.position.set(-3, 1.5, -2);
    this.scene.add(rim);
  }

  /** Sets the parts of the room that are covered on the right and below, in pixels. */
  cover(right: number, bottom: number): void {
    this.covered = { right, bottom };
    this.resize();
  }

  private resize(anew = true): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    this.shared.weave.anisotropy = this.renderer.capabilities.getMaxAnisotropy();
    const most = [2, 1, 0.75, 0.5][this.quality.level]!;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, most));
    this.renderer.setSize(width, height, false);
    // The part under the panel is not seen: the middle of the view is that of the rest.
    const seen = [width - this.covered.right, Math.max(height - this.covered.bottom, 120)] as const;
    this.camera.aspect = seen[0] / seen[1];
    this.camera.setViewOffset(seen[0], seen[1], 0, 0, width, height);
    if (anew && this.frame && this.objects.length > 0) this.fit();
  }

  private arrange(frame: Frame): void {
    if (this.objects.length !== frame.tracks.length) {
      this.objects.forEach((object) => {
        this.scene.remove(object.group);
        object.dispose();
      });
      this.objects = frame.tracks.map(() => new ClothObject(this.cloth!, this.edges!, this.shared));
      this.objects.forEach((object) => {
        object.simplify(this.quality.level);
        this.scene.add(object.group);
      });
      this.width = spread(frame.tracks) * 1.18 + 0.1;
      this.fitted = false;
    }
    const looks = this.theme.looks;
    const lines = new three.Color(this.theme.lines);
    this.objects.forEach((object, track) => {
      object.group.position.z = this.offset(track);
      object.place(frame.tracks[track]!);
      this.colour(object, frame, track);
      object.look(looks[track % looks.length]!, this.edgesShown, lines);
    });
    this.bodies.place(frame.bodies);
    // Bodies stand beside one cloth only.
    this.bodies.group.position.z = frame.tracks.length > 1 ? this.offset(0) : 0;
    this.arrangeHandles(frame);
  }

  private colour(object: ClothObject, frame: Frame, track: number): void {
    const positions = frame.tracks[track]!;
    switch (this.colouring) {
      case "plain":
        return object.colour(null);
      case "strain":
        this.edges!.strain(positions, object.field);
        break;
      case "bending":
        this.edges!.bending(positions, object.field);
        break;
      case "speed": {
        const before = this.before?.tracks[track];
        const seconds = this.before ? frame.time - this.before.time : 0;
        if (before && seconds > 0) speed(positions, before, seconds, object.field);
        break;
      }
      case "gap": {
        const gaps = frame.gaps[track];
        if (!gaps) return object.colour(null);
        object.field.set(gaps);
        break;
      }
      case "difference": {
        const other = frame.tracks[1 - track];
        if (!other) return object.colour(null);
        difference(positions, other, object.field);
        this.widen(object.field);
        break;
      }
    }
    object.colour(this.most);
  }

  /** Fits the scale of the difference to the largest one. */
  private widen(field: Float32Array): void {
    const largest = field.reduce((a, b) => Math.max(a, b), 0);
    const steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5];
    const fitting = steps.find((step) => step >= largest) ?? 10;
    if (fitting > this.most || largest < 0.2 * this.most) this.most = fitting;
  }

  private arrangeHandles(frame: Frame): void {
    this.marks.begin();
    for (let track = 0; track < frame.tracks.length && this.handlesShown; track++) {
      for (const goal of frame.goals) {
        const wanted = new three.Vector3(goal.x, goal.y, goal.z + this.offset(track));
        this.marks.add(this.point(track, goal.vertex), wanted, this.selected.has(goal.vertex));
      }
    }
    this.marks.end();
  }

  pickHandle(x: number, y: number, reach: number): Hit | null {
    let best: Hit | null = null;
    let nearest = reach;
    for (let track = 0; track < this.objects.length; track++) {
      for (const { vertex } of this.frame!.goals) {
        const point = this.point(track, vertex);
        const at = this.onScreen(point);
        const distance = Math.hypot(at.x - x, at.y - y);
        if (distance < nearest) {
          nearest = distance;
          best = { vertex, track, point, isHandle: true };
        }
      }
    }
    return best;
  }
}

/** Returns true where the processor computes pictures: then most is left out from the start. */
function isSoftware(context: WebGLRenderingContext | WebGL2RenderingContext): boolean {
  const about = context.getExtension("WEBGL_debug_renderer_info");
  const name: unknown = context.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  return /swiftshader|llvmpipe|software/i.test(String(name));
}

/** The width of the widest track along z, m. */
function spread(tracks: Float32Array[]): number {
  const widths = tracks.map((positions) => {
    let low = Infinity;
    let high = -Infinity;
    for (let k = 2; k < positions.length; k += 3) {
      low = Math.min(low, positions[k]!);
      high = Math.max(high, positions[k]!);
    }
    return high - low;
  });
  return Math.max(...widths);
}
