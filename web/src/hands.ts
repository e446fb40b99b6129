// The person's hands: pointers that drag handles, or take hold of any vertex, and keys that move
// all handles.

import * as three from "three";
import type { Link } from "./link";
import * as protocol from "./protocol";
import type { BodyHit, Hit, Stage } from "./stage";

interface Grip {
  hit: Hit;
  plane: three.Plane;
  /** From the point that was hit to each vertex that goes with it. */
  moved: { vertex: number; away: three.Vector3 }[];
  /** True where the vertex was taken hold of just now. */
  isNew: boolean;
  hasMoved: boolean;
}

/** A body that is led. */
interface BodyGrip {
  body: number;
  plane: three.Plane;
  from: three.Vector3;
  /** Its middle when it was taken hold of. */
  middle: three.Vector3;
}

/** The speed of a throw, m/s, and how far before the cloth the ball begins, m. */
const THROW = 5;
const BEFORE = 1.2;

export class Hands {
  /** True where the next click throws the ball. */
  throws = false;
  /** Told when the ball was thrown. */
  onThrown = () => {};
  /** True where a vertex that was taken hold of is let go with the pointer. */
  letsGo = false;
  /** The last drag that was sent, and when its event happened. */
  readonly sent: { number: number; at: number }[] = [];
  private readonly grips = new Map<number, Grip>();
  private readonly led = new Map<number, BodyGrip>();
  private readonly held = new Set<string>();
  private number = 0;
  private push = "";

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly stage: Stage,
    private readonly link: Link,
    private readonly canDrag: () => boolean,
  ) {
    const target = canvas.parentElement!;
    // Before the camera's controls hear of it.
    target.addEventListener("pointerdown", (event) => this.down(event), { capture: true });
    target.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    for (const name of ["pointerup", "pointercancel"] as const) {
      target.addEventListener(name, (event) => this.up(event), { capture: true });
    }
    canvas.addEventListener("dblclick", (event) => this.release(event));
    window.addEventListener("keydown", (event) => this.key(event, true));
    window.addEventListener("keyup", (event) => this.key(event, false));
    window.addEventListener("blur", () => {
      this.held.clear();
      this.sendPush();
    });
  }

  private at(event: PointerEvent | MouseEvent): { x: number; y: number } {
    const size = this.canvas.getBoundingClientRect();
    return { x: event.clientX - size.left, y: event.clientY - size.top };
  }

  private down(event: PointerEvent): void {
    if (event.target !== this.canvas || event.button !== 0 || !this.canDrag()) return;
    const { x, y } = this.at(event);
    if (this.throws) {
      event.stopPropagation();
      this.throw(x, y);
      return;
    }
    const body = this.stage.pickBody(x, y);
    if (body && !this.stage.pickHandle(x, y, 10)) {
      event.stopPropagation();
      this.takeBody(event.pointerId, body);
      return;
    }
    const hit = this.stage.pick(x, y, event.pointerType === "touch" ? 28 : 16);
    if (!hit) return;
    event.stopPropagation();
    this.canvas.setPointerCapture(event.pointerId);
    this.stage.controls.enabled = false;
    this.stage.dragging = true;
    const selected = this.stage.selected;
    if (hit.isHandle && event.shiftKey) {
      if (!selected.delete(hit.vertex)) selected.add(hit.vertex);
    } else if (!selected.has(hit.vertex)) {
      selected.clear();
    }
    const together = selected.has(hit.vertex) ? [...selected] : [hit.vertex];
    const normal = this.stage.camera.getWorldDirection(new three.Vector3());
    this.grips.set(event.pointerId, {
      hit,
      plane: new three.Plane().setFromNormalAndCoplanarPoint(normal, hit.point),
      moved: together.map((vertex) => ({
        vertex,
        away: this.stage.point(hit.track, vertex).sub(hit.point),
      })),
      isNew: !hit.isHandle,
      hasMoved: false,
    });
    this.canvas.style.cursor = "grabbing";
  }

  /** Throws the ball from before the cloth, or the middle of the view, to where the pointer is. */
  throw(x: number, y: number): void {
    const { stage } = this;
    const ray = stage.ray(x, y).ray;
    const hit = stage.pick(x, y, 0);
    const middle = stage.controls.target;
    const distance = hit ? hit.point.distanceTo(ray.origin) : middle.distanceTo(ray.origin);
    const goal = ray.at(distance, new three.Vector3());
    const from = ray.at(Math.max(distance - BEFORE, 0.1), new three.Vector3());
    const seconds = goal.distanceTo(from) / THROW;
    const velocity = goal.clone().sub(from).divideScalar(seconds);
    // It falls on its way.
    velocity.y += 0.5 * 9.8 * seconds;
    this.link.command({ do: "throw", from: from.toArray(), velocity: velocity.toArray() });
    this.throws = false;
    this.onThrown();
  }

  private takeBody(pointer: number, { body, point }: BodyHit): void {
    this.canvas.setPointerCapture(pointer);
    this.stage.controls.enabled = false;
    this.stage.dragging = true;
    const normal = this.stage.camera.getWorldDirection(new three.Vector3());
    this.led.set(pointer, {
      body,
      plane: new three.Plane().setFromNormalAndCoplanarPoint(normal, point),
      from: point.clone(),
      middle: this.stage.bodies.middle(body),
    });
    this.canvas.style.cursor = "grabbing";
  }

  private lead(event: PointerEvent, grip: BodyGrip): void {
    const { x, y } = this.at(event);
    const point = this.stage.ray(x, y).ray.intersectPlane(grip.plane, new three.Vector3());
    if (!point) return;
    const middle = grip.middle.clone().add(point).sub(grip.from);
    this.link.command({ do: "body", number: grip.body, middle: middle.toArray() });
  }

  private move(event: PointerEvent): void {
    const led = this.led.get(event.pointerId);
    if (led) {
      event.stopPropagation();
      this.lead(event, led);
      return;
    }
    const grip = this.grips.get(event.pointerId);
    if (!grip) {
      if (event.target === this.canvas && event.buttons === 0 && event.pointerType === "mouse") this.hover(event);
      return;
    }
    event.stopPropagation();
    const { x, y } = this.at(event);
    const size = this.canvas.getBoundingClientRect();
    const ray = new three.Raycaster();
    ray.setFromCamera(new three.Vector2((x / size.width) * 2 - 1, 1 - (y / size.height) * 2), this.stage.camera);
    const point = ray.ray.intersectPlane(grip.plane, new three.Vector3());
    if (!point) return;
    grip.hasMoved = true;
    const offset = this.stage.offset(grip.hit.track);
    const goals = grip.moved.map(({ vertex, away }) => ({
      vertex,
      x: point.x + away.x,
      y: point.y + away.y,
      z: point.z + away.z - offset,
    }));
    this.number += 1;
    this.sent.push({ number: this.number, at: event.timeStamp });
    if (this.sent.length > 600) this.sent.splice(0, 300);
    this.link.send(protocol.drag(this.number, goals));
  }

  private hover(event: PointerEvent): void {
    const { x, y } = this.at(event);
    const hit = this.canDrag() ? (this.stage.pick(x, y, 16) ?? this.stage.pickBody(x, y)) : null;
    this.canvas.style.cursor = this.throws ? "crosshair" : hit ? "grab" : "";
  }

  private up(event: PointerEvent): void {
    if (this.led.delete(event.pointerId)) {
      event.stopPropagation();
      this.rest();
    }
    const grip = this.grips.get(event.pointerId);
    if (!grip) return;
    event.stopPropagation();
    this.grips.delete(event.pointerId);
    this.rest();
    if (grip.isNew && grip.hasMoved && this.letsGo) {
      this.link.command({ do: "let-go", vertices: [grip.hit.vertex] });
    }
  }

  /** Gives the view back where no pointer holds anything. */
  private rest(): void {
    if (this.grips.size + this.led.size > 0) return;
    this.stage.controls.enabled = true;
    this.stage.dragging = false;
    this.canvas.style.cursor = "";
  }

  private release(event: MouseEvent): void {
    const { x, y } = this.at(event);
    const hit = this.canDrag() ? this.stage.pick(x, y, 16) : null;
    if (hit?.isHandle) {
      this.stage.selected.delete(hit.vertex);
      this.link.command({ do: "let-go", vertices: [hit.vertex] });
    }
  }

  private key(event: KeyboardEvent, down: boolean): void {
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!MOVES.has(name)) return;
    if (down && (isTyping(event.target, name) || event.ctrlKey || event.metaKey || event.altKey)) return;
    if (down) {
      event.preventDefault();
      this.held.add(name);
    } else if (!this.held.delete(name)) {
      return;
    }
    this.sendPush();
  }

  private sendPush(): void {
    const towards = (one: string, other: string) => Number(this.held.has(one)) - Number(this.held.has(other));
    const ahead = this.stage.camera.getWorldDirection(new three.Vector3()).setY(0).normalize();
    const right = new three.Vector3(-ahead.z, 0, ahead.x);
    const direction = ahead
      .multiplyScalar(towards("ArrowUp", "ArrowDown"))
      .addScaledVector(right, towards("ArrowRight", "ArrowLeft"))
      .add(new three.Vector3(0, towards("PageUp", "PageDown"), 0))
      .clampLength(0, 1);
    const turn = towards("q", "e");
    const push = [direction.x, direction.y, direction.z, turn] as const;
    if (push.join() !== this.push) {
      this.push = push.join();
      this.link.send(protocol.keys(...push));
    }
  }
}

const MOVES = new Set(["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "PageUp", "PageDown", "q", "e"]);

/** Returns true for a key that belongs to the control with the focus. */
export function isTyping(target: EventTarget | null, key: string): boolean {
  if (target instanceof HTMLSelectElement || target instanceof HTMLTextAreaElement) return true;
  if (target instanceof HTMLInputElement) {
    return target.type === "range" ? key.startsWith("Arrow") || key.startsWith("Page") : target.type !== "checkbox";
  }
  return false;
}
