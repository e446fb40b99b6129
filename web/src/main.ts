// The page of the live viewer: what comes over the socket is drawn, what a person does is sent.

import { Clip, save, savePicture } from "./capture";
import { Hands } from "./hands";
import { type Link, type Listener, SocketLink, WorkerLink, oneFile } from "./link";
import { Meters } from "./meters";
import { Panel, element } from "./panel";
import { labelPlace, type Place } from "./places";
import { drag, type Goal, type Message, type Mover, type State } from "./protocol";
import { Stage } from "./stage";

/** True in the page that needs no program, as build.mjs says. */
declare const WITHOUT_PROGRAM: boolean;

const asked = new URLSearchParams(location.search);
// A figure of a text: the cloth alone.
document.body.classList.toggle("figure", asked.has("figure"));

const canvas = element<HTMLCanvasElement>("canvas");
const stage = new Stage(canvas);
let client = 0;
let state: State | null = null;

const listener: Listener = {
  message(message: Message) {
    switch (message.kind) {
      case "hello":
        client = message.hello.client;
        panel.offer(message.hello.catalogue);
        break;
      case "cloth":
        stage.setCloth(message.cloth);
        break;
      case "state":
        state = message.state;
        panel.show(state);
        meters.show(state);
        break;
      case "frame":
        stage.take(message.frame);
        meters.frame(message.frame, client);
        break;
      case "file":
        save(new Blob([message.file.contents]), message.file.name);
        break;
    }
  },
  status(status, reason) {
    queueMicrotask(() => {
      panel.connected(status, reason);
      if (status !== "open") meters.stop();
    });
  },
};
const beginning = { scene: asked.get("scene") ?? oneFile?.scene ?? "tablecloth", mover: (asked.get("mover") ?? "physics") as Mover };
const link: Link = WITHOUT_PROGRAM ? new WorkerLink(listener, beginning, canvas) : new SocketLink(listener);
const hands = new Hands(canvas, stage, link, () => panel.isLive);
const panel = new Panel(stage, link, hands);
const meters = new Meters(hands);

const clip = new Clip(canvas);
element("picture").addEventListener("click", () => savePicture(canvas, () => stage.draw()));
element("clip").toggleAttribute("disabled", !Clip.isPossible);
element("clip").addEventListener("click", () => {
  if (clip.isOn) clip.stop();
  else clip.start();
  element("clip").setAttribute("aria-pressed", String(clip.isOn));
  element("clip").textContent = clip.isOn ? "End clip" : "Clip";
});

/** Names over the cloths, where there are several or one has stopped. */
function label(): void {
  const labels = element("labels");
  const tracks = state?.tracks ?? [];
  const frame = stage.frame;
  const wanted = frame && frame.tracks.length === tracks.length && (tracks.length > 1 || tracks[0]?.stopped || tracks[0]?.stand_in);
  const spans = [...labels.children] as HTMLElement[];
  const count = wanted ? tracks.length : 0;
  while (spans.length < count) spans.push(labels.appendChild(document.createElement("span")));
  spans.splice(count).forEach((span) => span.remove());
  const places: Place[] = [];
  spans.forEach((span, index) => {
    const track = tracks[index]!;
    const positions = frame!.tracks[index]!;
    let top = 0;
    for (let vertex = 1; vertex < positions.length / 3; vertex++) {
      if (positions[3 * vertex + 1]! > positions[3 * top + 1]!) top = vertex;
    }
    const point = stage.point(index, top);
    point.z = middle(positions) + stage.offset(index);
    const at = stage.onScreen(point);
    places.push(labelPlace(at, stage.together ? places[index - 1] : undefined));
    span.style.left = `${places[index]!.x}px`;
    span.style.top = `${places[index]!.y}px`;
    span.textContent = track.stopped ? `${track.name} stopped` : track.stand_in ? `${track.name}: ${track.stand_in}` : track.name;
    span.classList.toggle("stopped", track.stopped !== null);
  });
}

function middle(positions: Float32Array): number {
  let low = Infinity;
  let high = -Infinity;
  for (let k = 2; k < positions.length; k += 3) {
    low = Math.min(low, positions[k]!);
    high = Math.max(high, positions[k]!);
  }
  return (low + high) / 2;
}

function clock(): void {
  const time = stage.frame?.time;
  element("clock").textContent = time === undefined ? "" : `${time.toFixed(1)} s`;
}

function loop(): void {
  stage.draw();
  meters.picture();
  label();
  clock();
  requestAnimationFrame(loop);
}
requestAnimationFrame(loop);

// For tests and measurements.
Object.assign(window, {
  selvedge: {
    stage,
    meters,
    drag: (goals: Goal[]) => link.send(drag(0, goals)),
    get state() {
      return state;
    },
  },
});
