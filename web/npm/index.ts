import init, { Cloth as Module, type ClothSnapshot, type InitOutput } from "./selvedge_web.js";

/** A state of a cloth in memory; `free()` gives the memory back. */
export type Snapshot = ClothSnapshot;

/** What moves a cloth, and where the module is. */
export interface Options {
  /** A shipped learned model; without one the solver moves the cloth. */
  model?: string;
  /** Where `selvedge_web_bg.wasm` is, if not beside this file; or its bytes. */
  wasm?: URL | string | Response | BufferSource;
}

let loaded: Promise<InitOutput> | undefined;

async function load(wasm: Options["wasm"]): Promise<InitOutput> {
  const isNode = "process" in globalThis && !("window" in globalThis) && !("WorkerGlobalScope" in globalThis);
  if (wasm === undefined && isNode) {
    // Node fetches no files.
    const files = "node:fs/promises";
    const { readFile } = await import(/* @vite-ignore */ files);
    wasm = await readFile(new URL("selvedge_web_bg.wasm", import.meta.url));
  }
  return init(wasm === undefined ? undefined : { module_or_path: wasm });
}

/** Refuses options that are misspelt. */
function onlyOptions(given: object, known: readonly string[]): void {
  const other = Object.keys(given).find((name) => !known.includes(name));
  if (other !== undefined) throw new TypeError(`${other}: there is no such option; there are ${known.join(", ")}`);
}

/** The number of a body as the module takes it, which makes 0 of what is no number. */
function bodyNumber(body: number): number {
  if (Number.isInteger(body) && body >= 0 && body < 2 ** 32) return body;
  throw new RangeError(`body: ${String(body)} is no number of a body: they count 0, 1, 2 in the order of the scene`);
}

/** A cloth of a scene, moved by the solver or by a learned model. */
export class Cloth {
  /** Corners of the faces, three vertices each. */
  readonly faces: Uint32Array;
  /** The held vertices. */
  readonly handles: Uint32Array;
  /** Corners of the faces of all bodies, three points each. */
  readonly bodyFaces: Uint32Array;
  readonly vertexCount: number;
  /** Frames per second. */
  readonly frameRate: number;

  private constructor(
    private readonly cloth: Module,
    private readonly memory: WebAssembly.Memory,
  ) {
    this.faces = cloth.faces;
    this.handles = cloth.handles;
    this.bodyFaces = cloth.bodyFaces;
    this.vertexCount = cloth.vertexCount;
    this.frameRate = cloth.frameRate;
  }

  /**
   * The cloth of a shipped scene, or of the text of a scene's file, where the scene starts. Its rest
   * pose is sought first, which may take a second.
   */
  static async load(scene = "default", options: Options = {}): Promise<Cloth> {
    onlyOptions(options, ["model", "wasm"]);
    const { model, wasm } = options;
    // The module would read its memory at any other value.
    for (const [name, value] of Object.entries({ scene, model: model ?? "" })) {
      if (typeof value !== "string") throw new TypeError(`${name}: expected a text, found ${String(value)}`);
    }
    loaded ??= load(wasm);
    try {
      const { memory } = await loaded;
      return new Cloth(new Module(scene, model), memory);
    } catch (error) {
      // Another try may know better where the module is.
      loaded = undefined;
      throw error;
    }
  }

  /**
   * One frame on. The handles go to `targets`, x, y and z of each in m, or without them along the
   * scene's own motion.
   */
  step(targets?: ArrayLike<number>): void {
    this.cloth.step(targets && Float64Array.from(targets));
  }

  /**
   * Leads a body, of its number in the scene, in the next frame: by the rigid motion of a 4×4 matrix
   * (as `elements` of three.js's Matrix4) away from where the scene has it. It stays until it is led on.
   */
  leadBody(body: number, matrix: ArrayLike<number>): void {
    this.cloth.leadBody(bodyNumber(body), Float64Array.from(matrix));
  }

  /**
   * Sets the cloth elsewhere between two frames, as a character that appears in another place, by the
   * rigid motion of a 4×4 matrix; the bodies of these numbers go along. It swings on as it did.
   */
  teleport(matrix: ArrayLike<number>, bodies: ArrayLike<number> = []): void {
    this.cloth.teleport(Float64Array.from(matrix), Uint32Array.from(bodies, bodyNumber));
  }

  /** x, y and z of each vertex, m: a view into the module's memory, to be read before the next call. */
  get positions(): Float32Array {
    return new Float32Array(this.memory.buffer, this.cloth.positionsOffset(), 3 * this.vertexCount);
  }

  /** x, y and z of the points of all bodies, m. */
  bodyPoints(): Float32Array {
    return this.cloth.bodyPoints();
  }

  /** The number of the frame, along the scene's own motion. */
  get frame(): number {
    return this.cloth.frame;
  }

  /** All that is to be known of the cloth so far, one warning a line. */
  get warnings(): string {
    return this.cloth.warnings;
  }

  /** Back to the start. */
  reset(): void {
    this.cloth.reset();
  }

  /** The state now, for `restore`. */
  snapshot(): Snapshot {
    const taken = this.cloth.snapshot();
    if (!taken) throw new Error("this cloth cannot go back");
    return taken;
  }

  /** Back to a snapshot of this cloth: the frames that follow have the same bytes. */
  restore(snapshot: Snapshot): void {
    if ((snapshot as { __wbg_ptr?: number } | null)?.__wbg_ptr === 0) throw new Error("this snapshot was freed: take another");
    this.cloth.restore(snapshot);
  }

  /** Gives the memory back; the cloth can then no longer be used. */
  free(): void {
    this.cloth.free();
    const freed = () => {
      throw new Error("this cloth was freed: load another");
    };
    Object.defineProperty(this, "cloth", { get: freed });
  }
}

/** Whatever stands in the world: a bone, a mesh, any Object3D of three.js. */
export interface Placed {
  /** Its place as a 4×4 matrix, by columns. */
  readonly matrixWorld: { readonly elements: ArrayLike<number> };
}

/** How a worn cloth follows. */
export interface Following {
  /** Frames of the cloth in one of the page, at most. What a longer one has more is left out: the cloth is set
   * on by as much. Default 4. */
  mostFrames?: number;
  /** What moves faster than this, m/s, is taken to be set elsewhere: the cloth goes along rigidly, and the bodies
   * take a quarter of a second to where their bones are. Default 10. */
  fastest?: number;
}

/** A rotation (x, y, z, w) and a translation. */
type Place = readonly [number, number, number, number, number, number, number];

const still: Place = [0, 0, 0, 1, 0, 0, 0];

function placeOf({ matrixWorld: { elements } }: Placed): Place {
  const e = Array.from(elements);
  const sizes = [0, 4, 8].map((at) => Math.hypot(e[at]!, e[at + 1]!, e[at + 2]!));
  const m = (row: number, column: number) => e[4 * column + row]! / sizes[column]!;
  const volume = [0, 1, 2].reduce((sum, k) => {
    const [i, j] = [(k + 1) % 3, (k + 2) % 3];
    return sum + m(k, 2) * (m(i, 0) * m(j, 1) - m(j, 0) * m(i, 1));
  }, 0);
  if (!(Math.abs(volume) > 0) || !e.slice(12, 15).every(Number.isFinite)) {
    throw new RangeError(`matrixWorld: expected 16 numbers by columns, without a scale of 0, found ${e.join(", ")}`);
  }
  // As three.js has it, a mirror goes along the first axis.
  if (volume < 0) sizes[0] = -sizes[0]!;
  // The largest of the four has the most digits.
  const squares = [
    1 + m(0, 0) - m(1, 1) - m(2, 2), 1 - m(0, 0) + m(1, 1) - m(2, 2),
    1 - m(0, 0) - m(1, 1) + m(2, 2), 1 + m(0, 0) + m(1, 1) + m(2, 2),
  ];
  const [a, b, c] = [m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)];
  const [d, f, g] = [m(1, 0) + m(0, 1), m(0, 2) + m(2, 0), m(2, 1) + m(1, 2)];
  const most = squares.indexOf(Math.max(...squares));
  const q = [[squares[0]!, d, f, a], [d, squares[1]!, g, b], [f, g, squares[2]!, c], [a, b, c, squares[3]!]][most]!;
  const length = Math.hypot(...q);
  return [q[0]! / length, q[1]! / length, q[2]! / length, q[3]! / length, e[12]!, e[13]!, e[14]!];
}

/** Where a point goes. */
function moved([x, y, z, w, ...by]: Place, p: ArrayLike<number>): [number, number, number] {
  const [a, b, c] = [p[0]!, p[1]!, p[2]!];
  const [u, v, t] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * u + y * t - z * v + by[0]!, b + w * v + z * u - x * t + by[1]!, c + w * t + x * v - y * u + by[2]!];
}

function inverse([x, y, z, w, ...by]: Place): Place {
  const back: Place = [-x, -y, -z, w, 0, 0, 0];
  const [a, b, c] = moved(back, by);
  return [-x, -y, -z, w, -a, -b, -c];
}

/** `last` after `first`. */
function after(last: Place, first: Place): Place {
  const [a, b, c, d] = last;
  const [x, y, z, w, ...by] = first;
  const turn = [d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w, d * w - a * x - b * y - c * z] as const;
  return [...turn, ...moved(last, by)];
}

function between(from: Place, to: Place, part: number): Place {
  const turns = from.slice(0, 4).reduce((sum, x, k) => sum + x * to[k]!, 0);
  const mixed = from.map((x, k) => x * (1 - part) + to[k]! * part * (k < 4 && turns < 0 ? -1 : 1));
  const length = Math.hypot(...mixed.slice(0, 4));
  return mixed.map((x, k) => (k < 4 ? x / length : x)) as unknown as Place;
}

function matrixOf(place: Place): number[] {
  const turn: Place = [place[0], place[1], place[2], place[3], 0, 0, 0];
  return [...moved(turn, [1, 0, 0]), 0, ...moved(turn, [0, 1, 0]), 0, ...moved(turn, [0, 0, 1]), 0, ...place.slice(4), 1];
}

/**
 * A cloth that a character wears: its handles go with one bone, its bodies each with theirs. When it is
 * made, the bones stand as the scene has the bodies. Call `update` once a frame of the page.
 */
export class Worn {
  private readonly begin: Place[];
  private readonly held: number[][];
  private last: Place[];
  private waiting = 0;
  /** Frames in which the bodies still go to where their bones are, after a jump. */
  private catchingUp = 0;
  /** How the anchor went in the last frame, in its own axes. */
  private step: Place = still;

  constructor(
    readonly cloth: Cloth,
    private readonly anchor: Placed,
    private readonly bodies: readonly Placed[],
    private readonly following: Following = {},
  ) {
    onlyOptions(following, ["mostFrames", "fastest"]);
    const { mostFrames = 4, fastest = 10 } = following;
    if (!(Number.isInteger(mostFrames) && mostFrames > 0)) throw new RangeError(`mostFrames: expected 1 or more, found ${mostFrames}`);
    if (!(fastest > 0)) throw new RangeError(`fastest: expected a speed above 0 in m/s, found ${fastest}`);
    this.begin = [anchor, ...bodies].map((bone) => inverse(placeOf(bone)));
    this.held = Array.from(cloth.handles, (v) => Array.from(cloth.positions.slice(3 * v, 3 * v + 3)));
    this.last = this.now();
  }

  /** How far the bones are from where they began. */
  private now(): Place[] {
    return [this.anchor, ...this.bodies].map((bone, k) => after(placeOf(bone), this.begin[k]!));
  }

  /**
   * Moves the cloth by the frames that fit into `seconds`, the time since the last call; returns how
   * many. What cannot be moved begins anew where the character stands, and is said as an `Error`.
   */
  update(seconds: number): number {
    const { mostFrames = 4, fastest = 10 } = this.following;
    if (Number.isNaN(+seconds)) throw new RangeError(`seconds: expected the time since the last call, found ${seconds}`);
    const frame = 1 / this.cloth.frameRate;
    this.waiting += Math.max(seconds, 0);
    const frames = Math.min(Math.floor(this.waiting / frame + 1e-6), mostFrames);
    if (frames === 0) return 0;
    this.waiting -= frames * frame;
    const now = this.now();
    const all = this.bodies.map((_, k) => k);
    const way = this.held.map((p) => {
      const [from, to] = [moved(this.last[0]!, p), moved(now[0]!, p)];
      return Math.hypot(...to.map((x, k) => x - from[k]!));
    });
    const jumps = Math.max(0, ...way) > fastest * frames * frame || this.waiting > frame;
    // Limbs that move as far within a frame would beat the cloth away.
    if (jumps) [this.catchingUp, this.waiting] = [Math.floor(0.25 / frame), 0];
    try {
      if (jumps) {
        // Beyond the jump, or the time that is left out, the handles go on as fast as before.
        let there = now[0]!;
        for (let k = 0; k < frames; k++) there = after(there, inverse(this.step));
        const to = after(there, inverse(this.last[0]!));
        this.cloth.teleport(matrixOf(to), all);
        this.last = this.last.map((place) => after(to, place));
      }
      for (let left = frames; left > 0; left--) {
        // Bodies go with the anchor, and beside it to where they shall be.
        const [from, to] = [inverse(this.last[0]!), inverse(now[0]!)];
        const anchor = between(this.last[0]!, now[0]!, 1 / left);
        this.step = after(from, anchor);
        const part = 1 / Math.max(left, this.catchingUp);
        this.last = this.last.map((last, k) => (k === 0 ? anchor : after(anchor, between(after(from, last), after(to, now[k]!), part))));
        this.catchingUp = Math.max(this.catchingUp - 1, 0);
        for (const body of all) this.cloth.leadBody(body, matrixOf(this.last[body + 1]!));
        this.cloth.step(this.held.flatMap((p) => moved(anchor, p)));
      }
      return frames;
    } catch (error) {
      this.cloth.reset();
      this.cloth.teleport(matrixOf(now[0]!), all);
      this.last = now.map(() => now[0]!);
      [this.catchingUp, this.step] = [Math.floor(0.25 / frame), still];
      throw error;
    }
  }
}
