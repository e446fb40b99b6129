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
  static async load(scene = "default", { model, wasm }: Options = {}): Promise<Cloth> {
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
    this.cloth.restore(snapshot);
  }

  /** Gives the memory back; the cloth can then no longer be used. */
  free(): void {
    this.cloth.free();
  }
}
