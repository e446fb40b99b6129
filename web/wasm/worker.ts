// The session of a page without a program: it runs here, beside the page, and speaks as over the
// socket.

import init, { Session } from "./pkg/selvedge_web.js";
import type { ToWorker } from "../src/link";

let session: Session | null = null;
/** Messages that came before the session could take them. */
const early: (ArrayBuffer | boolean)[] = [];

// A timer has a floor of four milliseconds, a message to oneself has none.
const soon = new MessageChannel();
let timer = 0;
let isSoon = false;
soon.port1.onmessage = () => {
  isSoon = false;
  turn();
};

function turn(): void {
  if (!session) return;
  try {
    const wait = session.turn((bytes: Uint8Array<ArrayBuffer>) => postMessage(bytes.buffer, { transfer: [bytes.buffer] }));
    if (wait < 1) turnSoon();
    else timer = setTimeout(turn, wait);
  } catch (error) {
    end(error);
  }
}

function turnSoon(): void {
  clearTimeout(timer);
  if (isSoon) return;
  isSoon = true;
  soon.port2.postMessage(null);
}

function take(message: ArrayBuffer | boolean): void {
  try {
    if (typeof message === "boolean") session!.watch(message);
    else session!.receive(new Uint8Array(message));
  } catch (error) {
    end(error);
  }
  turnSoon();
}

/** There is no session, or no more, for this reason. */
function end(reason: unknown): void {
  session = null;
  clearTimeout(timer);
  postMessage(reason instanceof Error ? reason.message : String(reason));
}

function unpacked(gzipped: Uint8Array<ArrayBuffer>): Promise<Response> {
  const bytes = new Blob([gzipped]).stream().pipeThrough(new DecompressionStream("gzip"));
  return Promise.resolve(new Response(bytes, { headers: { "Content-Type": "application/wasm" } }));
}

onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  if (typeof message === "boolean" || message instanceof ArrayBuffer) {
    if (session) take(message);
    else early.push(message);
    return;
  }
  init({ module_or_path: message.wasm ? unpacked(message.wasm) : "selvedge.wasm" }).then(() => {
    session = new Session(message.scene, message.mover);
    early.splice(0).forEach(take);
    turnSoon();
  }).catch(end);
};
