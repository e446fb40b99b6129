// The messages of the socket, as crates/selvedge-live/src/protocol/mod.rs documents them:
// little-endian, each beginning with [version u8, kind u8, 0 u16].

export const VERSION = 3;
export const SUBPROTOCOL = "selvedge.v3";

const HELLO = 1;
const CLOTH = 2;
const STATE = 3;
const FRAME = 4;
const FILE = 5;
const READY = 16;
const DRAG = 17;
const KEYS = 18;
const COMMAND = 19;

export interface Catalogue {
  scenes: string[];
  meshes: string[];
  vertices: number[];
  materials: string[];
  models: string[];
  motions: string[];
}

export interface Hello {
  client: number;
  program: string;
  catalogue: Catalogue;
}

export interface Cloth {
  generation: number;
  vertices: number;
  /** [faces, 3] */
  faces: Uint32Array;
  /** Points of the pattern at the corners of the faces, [faces, 3]; a seam's vertices have two. */
  corners: Uint32Array;
  /** [points, 2], m */
  material: Float32Array;
  bodies: Body[];
}

/** A body beside the cloth. */
export interface Body {
  /** 0 a thing, 1 the floor, 2 the ball. */
  kind: number;
  points: number;
  /** [faces, 3], among its own points */
  faces: Uint32Array;
}

export interface Goal {
  vertex: number;
  x: number;
  y: number;
  z: number;
}

export interface Frame {
  generation: number;
  number: number;
  /** Since the start, s. */
  time: number;
  client: number;
  drag: number;
  goals: Goal[];
  /** Per track [vertices, 3], m. */
  tracks: Float32Array[];
  /** The points of all bodies, [points, 3], m. */
  bodies: Float32Array;
  /** Per track the smallest gap of each vertex, [vertices], m; empty where there are none. */
  gaps: Float32Array[];
}

/** A file to save. */
export interface SavedFile {
  name: string;
  contents: Uint8Array<ArrayBuffer>;
}

export type Mover = "model" | "physics" | "both";

export interface Order {
  scene: string;
  mesh: { name: string; vertices: number } | null;
  material: string | null;
  model: string;
  touches: boolean;
}

export interface Track {
  name: string;
  kind: "model" | "physics" | null;
  step_ms: number;
  strain: number;
  /** Drape coefficient and folds, of a drape test. */
  drape: [number, number] | null;
  /** What moves it in the place of its mover, now and then. */
  stand_in: string | null;
  stopped: string | null;
}

export type Show =
  | { kind: "nothing" }
  | { kind: "live" }
  | { kind: "recording"; name: string; frame: number; frames: number };

export interface State {
  generation: number;
  order: Order;
  mover: Mover;
  show: Show;
  running: boolean;
  frame_rate: number;
  rate: number;
  kept: number;
  tracks: Track[];
  limits: { speed: number; acceleration: number };
  wind: [number, number, number];
  motion: { name: string; frame: number; frames: number } | null;
  recording: { frames: number; most: number } | null;
  recorded: string[];
  touches: boolean;
  gaps: boolean;
  can_replay: boolean;
  can_live: boolean;
  busy: string | null;
  remark: string | null;
  notice: { number: number; level: "good" | "bad"; text: string } | null;
  viewers: number;
}

export type Message =
  | { kind: "hello"; hello: Hello }
  | { kind: "cloth"; cloth: Cloth }
  | { kind: "state"; state: State }
  | { kind: "frame"; frame: Frame }
  | { kind: "file"; file: SavedFile };

export type Command =
  | { do: "pause" | "resume" | "step" | "reset" | "stop-motion" | "record" | "stop-recording" | "replay" | "live" }
  | { do: "order"; order: Order }
  | { do: "mover"; mover: Mover }
  | { do: "wind"; wind: [number, number, number] }
  | { do: "limits"; speed: number; acceleration: number }
  | { do: "hold" | "let-go"; vertices: number[] }
  | { do: "motion"; name: string }
  | { do: "seek"; frame: number }
  | { do: "rate"; rate: number }
  | { do: "body"; number: number; middle: [number, number, number] }
  | { do: "throw"; from: [number, number, number]; velocity: [number, number, number] }
  | { do: "drop" }
  | { do: "gaps"; shown: boolean };

export function decode(buffer: ArrayBuffer): Message {
  const view = new DataView(buffer);
  const version = view.getUint8(0);
  if (version !== VERSION) {
    throw new Error(`the program speaks version ${version}, this page ${VERSION}: reload the page`);
  }
  const kind = view.getUint8(1);
  switch (kind) {
    case HELLO:
      return { kind: "hello", hello: json(buffer) as Hello };
    case STATE:
      return { kind: "state", state: json(buffer) as State };
    case CLOTH:
      return { kind: "cloth", cloth: cloth(view, buffer) };
    case FRAME:
      return { kind: "frame", frame: frame(view, buffer) };
    case FILE:
      return { kind: "file", file: file(view, buffer) };
    default:
      throw new Error(`there is no message of kind ${kind}`);
  }
}

function json(buffer: ArrayBuffer): unknown {
  return JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4)));
}

function cloth(view: DataView, buffer: ArrayBuffer): Cloth {
  const vertices = view.getUint32(8, true);
  const faces = view.getUint32(12, true);
  const points = view.getUint32(16, true);
  return {
    generation: view.getUint32(4, true),
    vertices,
    faces: new Uint32Array(buffer, 20, 3 * faces),
    corners: new Uint32Array(buffer, 20 + 12 * faces, 3 * faces),
    material: new Float32Array(buffer, 20 + 24 * faces, 2 * points),
    bodies: bodies(view, buffer, 20 + 24 * faces + 8 * points),
  };
}

function bodies(view: DataView, buffer: ArrayBuffer, at: number): Body[] {
  const count = view.getUint32(at, true);
  at += 4;
  const found: Body[] = [];
  for (let body = 0; body < count; body++) {
    const faces = view.getUint32(at + 8, true);
    found.push({
      kind: view.getUint32(at, true),
      points: view.getUint32(at + 4, true),
      faces: new Uint32Array(buffer, at + 12, 3 * faces),
    });
    at += 12 + 12 * faces;
  }
  return found;
}

function frame(view: DataView, buffer: ArrayBuffer): Frame {
  const word = (place: number) => view.getUint32(4 * place, true);
  const handles = word(6);
  const count = word(7);
  const vertices = word(8);
  const goals: Goal[] = [];
  for (let handle = 0; handle < handles; handle++) {
    const at = 44 + 16 * handle;
    goals.push({
      vertex: view.getUint32(at, true),
      x: view.getFloat32(at + 4, true),
      y: view.getFloat32(at + 8, true),
      z: view.getFloat32(at + 12, true),
    });
  }
  const start = 44 + 16 * handles;
  const after = start + 12 * vertices * count;
  const points = word(9);
  const each = (size: number, from: number) =>
    Array.from({ length: count }, (_, track) => new Float32Array(buffer, from + 4 * size * track, size));
  const tracks = each(3 * vertices, start);
  const gaps = word(10) === vertices * count ? each(vertices, after + 12 * points) : [];
  return {
    generation: word(1),
    number: word(2),
    time: view.getFloat32(12, true),
    client: word(4),
    drag: word(5),
    goals,
    tracks,
    bodies: new Float32Array(buffer, after, 3 * points),
    gaps,
  };
}

function file(view: DataView, buffer: ArrayBuffer): SavedFile {
  const start = 8 + view.getUint32(4, true);
  return { name: new TextDecoder().decode(new Uint8Array(buffer, 8, start - 8)), contents: new Uint8Array(buffer, start) };
}

function message(kind: number, words: number): [ArrayBuffer, DataView] {
  const buffer = new ArrayBuffer(4 + 4 * words);
  const view = new DataView(buffer);
  view.setUint8(0, VERSION);
  view.setUint8(1, kind);
  return [buffer, view];
}

export function ready(number: number): ArrayBuffer {
  const [buffer, view] = message(READY, 1);
  view.setUint32(4, number, true);
  return buffer;
}

export function drag(number: number, goals: Goal[]): ArrayBuffer {
  const [buffer, view] = message(DRAG, 2 + 4 * goals.length);
  view.setUint32(4, number, true);
  view.setUint32(8, goals.length, true);
  goals.forEach((goal, index) => {
    const at = 12 + 16 * index;
    view.setUint32(at, goal.vertex, true);
    view.setFloat32(at + 4, goal.x, true);
    view.setFloat32(at + 8, goal.y, true);
    view.setFloat32(at + 12, goal.z, true);
  });
  return buffer;
}

export function keys(x: number, y: number, z: number, turn: number): ArrayBuffer {
  const [buffer, view] = message(KEYS, 4);
  [x, y, z, turn].forEach((part, index) => view.setFloat32(4 + 4 * index, part, true));
  return buffer;
}

export function command(command: Command): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(command));
  const bytes = new Uint8Array(4 + text.length);
  bytes[0] = VERSION;
  bytes[1] = COMMAND;
  bytes.set(text, 4);
  return bytes.buffer;
}
