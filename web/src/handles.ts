// The marks of the handles: a knob at each, and a line with a smaller knob to the place where a
// hand wants it.
//
// Knobs and lines live in one buffer each, and a part of it is drawn. A full buffer is replaced by
// one of twice the size.

import * as three from "three";

const KNOB = 0.016;
const SELECTED_KNOB = 0.024;
const GOAL_KNOB = 0.008;
/** A goal nearer than this to its handle has no mark, m. */
const NEAR = 0.01;

export class HandleMarks {
  readonly group = new three.Group();
  private readonly ball = new three.SphereGeometry(1, 24, 16);
  private readonly material = new three.MeshStandardMaterial({ roughness: 0.35 });
  private readonly lines: three.LineSegments<three.BufferGeometry, three.LineBasicMaterial>;
  private readonly matrix = new three.Matrix4();
  private knobs = this.makeKnobs(64);
  private ends = makeEnds(64);
  private knobCount = 0;
  private endCount = 0;

  constructor() {
    const faint = new three.LineBasicMaterial({ transparent: true, opacity: 0.7 });
    this.lines = new three.LineSegments(new three.BufferGeometry(), faint);
    this.lines.geometry.setAttribute("position", this.ends);
    this.lines.frustumCulled = false;
    this.group.add(this.knobs, this.lines);
  }

  /** Sets the colour of all marks. */
  look(colour: string): void {
    this.material.color.set(colour);
    this.lines.material.color.set(colour);
  }

  /** Starts a picture without marks. */
  begin(): void {
    this.knobCount = this.endCount = 0;
  }

  /** Marks a handle at `point` that is wanted at `goal`. */
  add(point: three.Vector3, goal: three.Vector3, selected: boolean): void {
    this.addKnob(point, selected ? SELECTED_KNOB : KNOB);
    if (point.distanceTo(goal) > NEAR) {
      this.addKnob(goal, GOAL_KNOB);
      this.addEnd(point);
      this.addEnd(goal);
    }
  }

  /** Hands the marks of the picture to the renderer. */
  end(): void {
    this.knobs.count = this.knobCount;
    this.knobs.instanceMatrix.needsUpdate = true;
    this.lines.geometry.setDrawRange(0, this.endCount);
    this.lines.visible = this.endCount > 0;
    this.ends.needsUpdate = true;
  }

  private addKnob(at: three.Vector3, radius: number): void {
    if (this.knobCount === this.knobs.instanceMatrix.count) this.growKnobs();
    this.matrix.makeScale(radius, radius, radius).setPosition(at);
    this.knobs.setMatrixAt(this.knobCount++, this.matrix);
  }

  private addEnd(at: three.Vector3): void {
    if (this.endCount === this.ends.count) this.growEnds();
    this.ends.setXYZ(this.endCount++, at.x, at.y, at.z);
  }

  private growKnobs(): void {
    const before = this.knobs;
    this.knobs = this.makeKnobs(2 * before.instanceMatrix.count);
    this.knobs.instanceMatrix.array.set(before.instanceMatrix.array);
    this.group.remove(before);
    this.group.add(this.knobs);
    // The ball and its material go on in the new knobs.
    before.dispose();
  }

  private growEnds(): void {
    const before = this.ends;
    this.ends = makeEnds(2 * before.count);
    this.ends.array.set(before.array);
    // The renderer forgets the old buffer with the geometry, which it takes up anew.
    this.lines.geometry.dispose();
    this.lines.geometry.setAttribute("position", this.ends);
  }

  private makeKnobs(most: number): three.InstancedMesh {
    const knobs = new three.InstancedMesh(this.ball, this.material, most);
    knobs.instanceMatrix.setUsage(three.DynamicDrawUsage);
    knobs.castShadow = true;
    knobs.frustumCulled = false;
    return knobs;
  }
}

/** Room for `most` ends of lines. */
function makeEnds(most: number): three.BufferAttribute {
  return new three.BufferAttribute(new Float32Array(3 * most), 3).setUsage(three.DynamicDrawUsage);
}
