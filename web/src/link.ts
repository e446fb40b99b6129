// The link to the session: a socket to the program, opened again when it is lost, and slower each
// time it fails; or, without a program, a worker of this page.

import * as protocol from "./protocol";

export type LinkStatus = "connecting" | "open" | "lost" | "refused";

export interface Listener {
  message(message: protocol.Message): void;
  status(status: LinkStatus, reason: string): void;
}

export abstract class Link {
  constructor(protected readonly listener: Listener) {}

  abstract send(bytes: ArrayBuffer): void;

  command(command: protocol.Command): void {
    this.send(protocol.command(command));
  }

  /** Returns the kind of the message, if it is one. */
  protected take(bytes: ArrayBuffer): protocol.Message["kind"] | null {
    let message: protocol.Message;
    try {
      message = protocol.decode(bytes);
    } catch (error) {
      this.listener.status("refused", String(error));
      return null;
    }
    if (message.kind === "frame") {
      // Says that this page keeps up; without it the session sends no more.
      this.send(protocol.ready(message.frame.number));
    }
    this.listener.message(message);
    return message.kind;
  }
}

export class SocketLink extends Link {
  private socket: WebSocket | null = null;
  private failures = 0;

  constructor(listener: Listener) {
    super(listener);
    this.open();
  }

  send(bytes: ArrayBuffer): void {
    if (this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(bytes);
    }
  }

  private open(): void {
    this.listener.status("connecting", "");
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`, protocol.SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.failures = 0;
      this.listener.status("open", "");
    };
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.take(event.data);
    socket.onclose = (event) => {
      this.failures += 1;
      // 1002 and 1003: what this page says is not understood; saying it again helps nobody.
      const refused = event.code === 1002 || event.code === 1003;
      this.listener.status(refused ? "refused" : "lost", event.reason);
      if (!refused) {
        setTimeout(() => this.open(), Math.min(250 * this.failures, 2000));
      }
    };
  }
}

/** The scene of a worker's session, and what moves it at first. */
export interface Beginning {
  scene: string;
  mover: protocol.Mover;
  /** The module, gzipped, where it is no file beside the page. */
  wasm?: Uint8Array<ArrayBuffer>;
}

/** What a page that is one file brings along; set before its script by `single.mjs`. */
interface OneFile {
  scene: string;
  /** Address of the worker's script. */
  worker: string;
  /** The module, gzipped. */
  wasm: Uint8Array<ArrayBuffer>;
}

export const oneFile = (globalThis as { selvedgeFile?: OneFile }).selvedgeFile;

/** Pictures of the first cloth before its time begins. */
const FIRST_PICTURES = 3;

/** What a worker is sent: its beginning, messages of the session, and whether anybody watches. */
export type ToWorker = Beginning | ArrayBuffer | boolean;

export class WorkerLink extends Link {
  private readonly worker = new Worker(oneFile?.worker ?? "worker.js", { type: oneFile ? "classic" : "module" });

  /**
   * Time stands still while `seen` is out of sight, and until the first pictures of the cloth are drawn: for them the
   * browser compiles shaders, for up to a second where a processor draws, and the solver would fall behind meanwhile.
   */
  constructor(listener: Listener, beginning: Beginning, seen: HTMLCanvasElement) {
    super(listener);
    listener.status("connecting", "");
    // A text says why there is no session, or no more.
    this.worker.onmessage = (event: MessageEvent<ArrayBuffer | string>) => {
      if (typeof event.data === "string") listener.status("refused", event.data);
      else if (this.take(event.data) === "frame" && pictures < 0) countPictures();
    };
    this.worker.onerror = (event) => listener.status("refused", event.message || "worker.js cannot be loaded");
    this.post({ ...beginning, wasm: oneFile?.wasm });
    listener.status("open", "");
    let isInView = true;
    let pictures = -1; // None yet.
    const watch = () => this.post(pictures >= FIRST_PICTURES && isInView && !document.hidden);
    const pixel = new Uint8Array(4);
    const countPictures = () => {
      pictures += 1;
      // Waits until the picture is there.
      const gl = seen.getContext("webgl2");
      gl?.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      if (pictures < FIRST_PICTURES) requestAnimationFrame(countPictures);
      else watch();
    };
    watch();
    new IntersectionObserver((entries) => {
      isInView = entries.at(-1)!.isIntersecting;
      watch();
    }).observe(seen);
    document.addEventListener("visibilitychange", watch);
  }

  send(bytes: ArrayBuffer): void {
    this.post(bytes);
  }

  private post(message: ToWorker): void {
    this.worker.postMessage(message);
  }
}
