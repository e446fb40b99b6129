// The meters: drawings and frames per second, and the time from a hand's move to its picture.

import type { Frame, State } from "./protocol";
import type { Hands } from "./hands";
import { element } from "./panel";

/** Largest strain of moving cloth of these materials; above it a prediction is doubtful. */
const USUAL_STRAIN = 0.35;
const WRONG_STRAIN = 0.6;

export class Meters {
  /** From the event of a drag to after the picture that follows it, ms; the latest last. */
  readonly latencies: number[] = [];
  fps = 0;
  private drawn = 0;
  private since = performance.now();
  private awaited: { at: number } | null = null;

  constructor(private readonly hands: Hands) {}

  frame(frame: Frame, client: number): void {
    if (frame.client !== client) return;
    const sent = this.hands.sent;
    const index = sent.findIndex((drag) => drag.number > frame.drag);
    const done = sent.splice(0, index < 0 ? sent.length : index);
    // The oldest move that this frame is the first to follow.
    if (done[0] && !this.awaited) this.awaited = { at: done[0].at };
  }

  /** A picture was drawn; it is painted when the browser has come round to other work. */
  picture(): void {
    this.drawn += 1;
    const awaited = this.awaited;
    if (!awaited) return;
    this.awaited = null;
    const channel = new MessageChannel();
    channel.port1.onmessage = () => {
      this.latencies.push(performance.now() - awaited.at);
      if (this.latencies.length > 2000) this.latencies.shift();
    };
    channel.port2.postMessage(null);
  }

  /** Nothing is known any more: the program does not answer. */
  stop(): void {
    for (const id of ["fps", "steps", "step-ms", "strain"]) element(id).textContent = "–";
    element("trust").className = "dot";
    element("trust").title = "not connected";
  }

  show(state: State): void {
    const now = performance.now();
    const seconds = (now - this.since) / 1000;
    if (seconds >= 0.95) {
      this.fps = this.drawn / seconds;
      this.drawn = 0;
      this.since = now;
    }
    element("fps").textContent = `${this.fps < 9.5 ? this.fps.toFixed(1) : Math.round(this.fps)} fps`;
    element("steps").textContent = state.running ? `${Math.round(state.kept * state.rate * state.frame_rate)} /s` : "paused";
    const times = state.tracks.filter((track) => track.kind !== null).map((track) => track.step_ms.toFixed(1));
    element("step-ms").textContent = times.length > 0 ? `${times.join(" + ")} ms` : "–";
    this.trust(state);
    const drapes = state.tracks.flatMap((track) => (track.drape ? [track.drape] : []));
    element("drape-box").hidden = drapes.length === 0;
    element("drape").textContent = drapes.map(([part, folds]) => `${part.toFixed(2)}, ${folds} folds`).join(" + ");
  }

  private trust(state: State): void {
    const strain = Math.max(0, ...state.tracks.map((track) => track.strain));
    element("strain").textContent = state.tracks.length > 0 ? `${(100 * strain).toFixed(0)} %` : "–";
    const stopped = state.tracks.some((track) => track.stopped !== null);
    const isDoubtful = strain > USUAL_STRAIN || state.remark !== null;
    const level = stopped || strain > WRONG_STRAIN ? "bad" : isDoubtful ? "doubt" : "good";
    element("trust").className = `dot ${level}`;
    const doubt = state.remark ?? "more than cloth usually does";
    element("trust").title = { good: "as cloth does", doubt, bad: "not to be trusted" }[level];
  }
}
