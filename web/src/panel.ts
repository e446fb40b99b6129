// Everything around the cloth: choices, sliders, buttons, and what they are told by the state.

import { SCALES, gradient, type Colouring } from "./colours";
import { isTyping, type Hands } from "./hands";
import type { Link, LinkStatus } from "./link";
import type { Catalogue, Command, Mover, Order, State } from "./protocol";
import type { Stage } from "./stage";

const PAPER = { speed: Math.PI / 2, acceleration: (Math.PI * Math.PI) / 2 };

export function element<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return found as T;
}

const input = (id: string) => element<HTMLInputElement>(id);
const select = (id: string) => element<HTMLSelectElement>(id);
const onClick = (id: string, then: () => void) => element(id).addEventListener("click", then);

export class Panel {
  private state: State | null = null;
  private seen = 0;
  private toast = 0;

  constructor(
    private readonly stage: Stage,
    private readonly link: Link,
    private readonly hands: Hands,
  ) {
    this.time();
    this.choices();
    this.handsAndWind();
    this.looks();
    this.shortcuts();
    element("legend-bar").style.background = gradient();
    const narrow = matchMedia("(max-width: 760px)");
    this.fold(narrow.matches);
    narrow.addEventListener("change", () => this.fold(narrow.matches));
  }

  get isLive(): boolean {
    return this.state?.show.kind === "live";
  }

  offer(catalogue: Catalogue): void {
    // The choices are shown anew.
    this.state = null;
    const fill = (id: string, names: (string | number)[], first?: string) => {
      const options = names.map((name) => new Option(String(name), String(name)));
      if (first !== undefined) options.unshift(new Option(first, ""));
      select(id).replaceChildren(...options);
    };
    fill("scene", catalogue.scenes);
    fill("mesh", catalogue.meshes, "the scene's own");
    fill("vertices", catalogue.vertices);
    fill("material", catalogue.materials, "the scene's own");
    fill("model", catalogue.models);
    fill("motion", ["scene", ...catalogue.motions]);
    select("motion").options[0]!.text = "the scene's own";
    select("vertices").value = "400";
  }

  connected(status: LinkStatus, reason: string): void {
    const dot = element("link");
    dot.className = `dot ${status === "open" ? "good" : status === "connecting" ? "doubt" : "bad"}`;
    dot.title = { open: "connected", connecting: "connecting", lost: "not connected: trying again", refused: `refused: ${reason}` }[status];
    document.body.dataset.link = status;
    const isGone = status === "lost" || status === "refused";
    if (isGone) {
      element("slow").textContent = status === "lost" ? "The program does not answer: trying again" : "Not connected";
      element("slow").hidden = false;
    } else if (status === "open") {
      element("slow").hidden = true;
    }
    if (status === "refused" || (status === "lost" && reason !== "")) this.say(reason, "bad");
  }

  /** Tells a person something for a while. */
  say(text: string, level: "good" | "bad"): void {
    const toast = element("toast");
    toast.textContent = text;
    toast.className = `card ${level}`;
    toast.hidden = false;
    clearTimeout(this.toast);
    this.toast = window.setTimeout(() => (toast.hidden = true), level === "bad" ? 9000 : 6000);
  }

  show(state: State): void {
    const before = this.state;
    this.state = state;
    document.body.classList.toggle("paused", !state.running);
    document.body.classList.toggle("playing", state.show.kind === "recording");
    element("pause").setAttribute("aria-label", state.running ? "Pause" : "Go on");
    this.showTime(state);
    this.showChoices(state, before);
    this.showHands(state);
    this.showKept(state);
    element("remark").textContent = state.remark ?? "";
    element("busy").hidden = state.busy === null;
    element("busy-text").textContent = state.busy ?? "";
    const notice = state.notice;
    if (notice && notice.number !== this.seen) {
      // A notice from before this page came is not shown.
      if (before) this.say(notice.text, notice.level);
      this.seen = notice.number;
    }
    this.legend();
  }

  private command(command: Command): void {
    this.link.command(command);
  }

  private time(): void {
    onClick("reset", () => this.command({ do: "reset" }));
    onClick("pause", () => this.command({ do: this.state?.running ? "pause" : "resume" }));
    onClick("step", () => this.command({ do: "step" }));
    onClick("record", () => this.command({ do: this.state?.recording ? "stop-recording" : "record" }));
    onClick("replay", () => this.command({ do: "replay" }));
    onClick("live", () => this.command({ do: "live" }));
    input("time").addEventListener("input", () => this.command({ do: "seek", frame: Number(input("time").value) }));
    select("rate").addEventListener("change", () => this.command({ do: "rate", rate: Number(select("rate").value) }));
    onClick("settings", () => {
      this.fold(!document.body.classList.contains("wide"));
    });
  }

  /** Puts the settings away, or brings them back. */
  private fold(away: boolean): void {
    document.body.classList.toggle("wide", away);
    element("settings").setAttribute("aria-expanded", String(!away));
    if (document.body.classList.contains("figure")) {
      this.stage.cover(0, 0);
      return;
    }
    const narrow = matchMedia("(max-width: 760px)").matches;
    const panel = element("panel").getBoundingClientRect();
    if (narrow) this.stage.cover(0, away ? 74 : innerHeight - panel.top);
    else this.stage.cover(away ? 0 : 316, 0);
  }

  private choices(): void {
    for (const button of element("mover").querySelectorAll<HTMLButtonElement>("button")) {
      button.addEventListener("click", () => this.command({ do: "mover", mover: button.dataset.mover as Mover }));
    }
    input("touches").addEventListener("change", () => this.order(false));
    for (const id of ["scene", "mesh", "vertices", "material", "model"]) {
      select(id).addEventListener("change", () => this.order(id === "scene"));
    }
    onClick("play-motion", () => {
      if (this.state?.motion) this.command({ do: "stop-motion" });
      else this.command({ do: "motion", name: select("motion").value });
    });
  }

  private order(another: boolean): void {
    const mesh = another ? "" : select("mesh").value;
    const order: Order = {
      scene: select("scene").value,
      mesh: mesh === "" ? null : { name: mesh, vertices: Number(select("vertices").value) },
      material: another ? null : select("material").value || null,
      model: select("model").value,
      touches: input("touches").checked && !input("touches").disabled,
    };
    this.command({ do: "order", order });
  }

  private handsAndWind(): void {
    const limits = () =>
      this.command({ do: "limits", speed: Number(input("speed").value), acceleration: Number(input("acceleration").value) });
    input("speed").addEventListener("input", limits);
    input("acceleration").addEventListener("input", limits);
    input("lets-go").addEventListener("change", () => (this.hands.letsGo = input("lets-go").checked));
    onClick("throw", () => this.arm(!this.hands.throws));
    this.hands.onThrown = () => this.arm(false);
    onClick("drop", () => this.command({ do: "drop" }));
    const wind = () => {
      const speed = Number(input("wind").value);
      const from = (Number(input("wind-from").value) * Math.PI) / 180;
      this.windValues();
      // From the front is along -x; degrees turn towards the viewer's right.
      this.command({ do: "wind", wind: [-speed * Math.cos(from), 0, speed * Math.sin(from)] });
    };
    input("wind").addEventListener("input", wind);
    input("wind-from").addEventListener("input", wind);
    this.windValues();
  }

  /** Has the next click throw the ball, or no longer. */
  private arm(throws: boolean): void {
    this.hands.throws = throws;
    element("throw").setAttribute("aria-pressed", String(throws));
    element("canvas").style.cursor = throws ? "crosshair" : "";
  }

  private windValues(): void {
    element("wind-value").textContent = `${Number(input("wind").value).toFixed(1)} m/s`;
    const from = Number(input("wind-from").value);
    const side = Math.abs(from) < 23 ? "the front" : Math.abs(from) > 157 ? "behind" : from > 0 ? "the right" : "the left";
    element("wind-from-value").textContent = `${side}, ${from}°`;
  }

  private looks(): void {
    select("colouring").addEventListener("change", () => {
      const colouring = select("colouring").value as Colouring;
      this.stage.colouring = colouring;
      this.command({ do: "gaps", shown: colouring === "gap" });
      if (colouring !== "plain") this.stage.most = SCALES[colouring].most * SCALES[colouring].factor;
      if (colouring === "difference" && this.state?.tracks.length === 1 && this.isLive) {
        this.command({ do: "mover", mover: "both" });
      }
      this.legend();
    });
    input("edges").addEventListener("change", () => (this.stage.edgesShown = input("edges").checked));
    input("handles").addEventListener("change", () => (this.stage.handlesShown = input("handles").checked));
    input("follows").addEventListener("change", () => (this.stage.follows = input("follows").checked));
    input("together").addEventListener("change", () => {
      this.stage.together = input("together").checked;
      this.stage.fit();
    });
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const apply = () => {
      const chosen = keptTheme();
      const shade = chosen === "auto" ? (dark.matches ? "dark" : "light") : chosen === "dark" ? "dark" : "light";
      document.documentElement.dataset.shade = shade;
      this.stage.setTheme(shade);
      check("theme", "theme", chosen);
    };
    for (const button of element("theme").querySelectorAll<HTMLButtonElement>("button")) {
      button.addEventListener("click", () => {
        keepTheme(button.dataset.theme ?? "auto");
        apply();
      });
    }
    dark.addEventListener("change", apply);
    apply();
  }

  private shortcuts(): void {
    const keys: Record<string, string> = { " ": "pause", ".": "step", Home: "reset", r: "record", b: "throw", d: "drop" };
    window.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || isTyping(event.target, event.key)) return;
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (key === "f") this.stage.fit();
      const id = keys[key];
      // Space presses the button that has the focus.
      if (id === undefined || (key === " " && event.target instanceof HTMLButtonElement)) return;
      event.preventDefault();
      element(id).click();
      // Back to the start is back to the view of it, too.
      if (key === "Home") this.stage.fitAtStart();
    });
  }

  private showTime(state: State): void {
    const show = state.show;
    const slider = input("time");
    slider.hidden = show.kind !== "recording";
    element("live").hidden = show.kind !== "recording";
    if (show.kind === "recording") {
      slider.max = String(show.frames - 1);
      if (document.activeElement !== slider || state.running) slider.value = String(show.frame);
    }
    const rate = select("rate");
    if (document.activeElement !== rate) rate.value = String(state.rate);
    const slow = element("slow");
    const lagging = state.running && state.kept < 0.93 && show.kind === "live" && state.tracks.some((track) => !track.stopped);
    slow.hidden = !lagging;
    if (lagging) {
      const step = state.tracks.reduce((sum, track) => sum + track.step_ms, 0);
      const why = step > 1000 / (state.frame_rate * state.rate) ? "A step takes longer than a frame" : "This machine is busy";
      slow.textContent = `${why}: time runs at ${(state.kept * state.rate).toFixed(2)}×`;
    }
  }

  private showChoices(state: State, before: State | null): void {
    check("mover", "mover", state.mover);
    const live = state.show.kind !== "recording";
    for (const button of element("mover").querySelectorAll("button")) button.disabled = !live;
    element("together-row").hidden = state.tracks.length < 2;
    if (!before || JSON.stringify(before.order) !== JSON.stringify(state.order)) {
      const order = state.order;
      select("scene").value = order.scene;
      select("mesh").value = order.mesh?.name ?? "";
      if (order.mesh) select("vertices").value = String(order.mesh.vertices);
      select("material").value = order.material ?? "";
      select("model").value = order.model;
    }
    // A scene that has contact of its own keeps it.
    input("touches").checked = state.order.touches || state.touches;
    input("touches").disabled = state.touches && !state.order.touches;
    // Without contact the cloth would fall through the floor that is shown.
    for (const id of ["throw", "drop"]) element(id).toggleAttribute("disabled", !live || !state.touches);
    element("touch-hint").textContent =
      state.touches && state.mover !== "physics" ? "A learned model does not see bodies: the solver can throw and lead them." : "";
    element("vertices-row").hidden = select("mesh").value === "";
    const motion = element("play-motion");
    motion.textContent = state.motion ? "Stop" : "Play";
    motion.toggleAttribute("disabled", !live);
  }

  private showHands(state: State): void {
    const { speed, acceleration } = state.limits;
    if (document.activeElement !== input("speed")) input("speed").value = String(speed);
    if (document.activeElement !== input("acceleration")) input("acceleration").value = String(acceleration);
    element("speed-value").textContent = `${speed.toFixed(2)} m/s`;
    element("acceleration-value").textContent = `${acceleration.toFixed(1)} m/s²`;
    const beyond = speed > PAPER.speed + 0.01 || acceleration > PAPER.acceleration + 0.01;
    const near = Math.abs(speed - PAPER.speed) < 0.01 && Math.abs(acceleration - PAPER.acceleration) < 0.01;
    element("limits-hint").textContent = beyond
      ? "Beyond what the paper trains on (1.57 m/s, 4.9 m/s²): the model has not seen this."
      : near
        ? "As in the paper's training motions."
        : "";
    const [x, , z] = state.wind;
    if (document.activeElement !== input("wind") && document.activeElement !== input("wind-from")) {
      input("wind").value = String(Math.hypot(x, z));
      if (Math.hypot(x, z) > 0) input("wind-from").value = String(Math.round((Math.atan2(z, -x) * 180) / Math.PI));
      this.windValues();
    }
  }

  private showKept(state: State): void {
    const record = element("record");
    record.setAttribute("aria-pressed", String(state.recording !== null));
    record.toggleAttribute("disabled", state.show.kind !== "live");
    element("record-text").textContent = state.recording ? `${(state.recording.frames / state.frame_rate).toFixed(1)} s` : "";
    element("replay").toggleAttribute("disabled", !state.can_replay || state.show.kind === "recording");
    element("recorded").textContent = state.recorded.join(", ");
  }

  private legend(): void {
    const colouring = this.stage.colouring;
    const tracks = this.state?.tracks.length ?? 0;
    const shown = colouring !== "plain" && !(colouring === "difference" && tracks < 2);
    element("legend").hidden = !shown;
    if (colouring === "plain" || !shown) return;
    const scale = SCALES[colouring];
    element("legend-title").textContent = scale.title;
    element("legend-most").textContent = `${Number((this.stage.most / scale.factor).toPrecision(3))} ${scale.unit}`;
  }
}

/** The theme of the last visit. A page inside another may be denied the memory of it. */
function keptTheme(): string {
  try {
    return localStorage.getItem("theme") ?? theme;
  } catch {
    return theme;
  }
}

function keepTheme(chosen: string): void {
  theme = chosen;
  try {
    localStorage.setItem("theme", chosen);
  } catch {
    // It lasts as long as this page.
  }
}

let theme = "auto";

/** Marks the button of a group whose data is `value`. */
function check(group: string, data: string, value: string): void {
  for (const button of element(group).querySelectorAll<HTMLButtonElement>("button")) {
    button.setAttribute("aria-checked", String(button.dataset[data] === value));
  }
}
