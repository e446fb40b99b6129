// A recording to play, as large as is asked for: a sheet of side × side vertices with a wave
// running through it, written as a trajectory file (ARCHITECTURE.md, "Files").
import { writeFileSync } from "node:fs";

export function writeRecording(file, side, frames) {
  const vertices = side * side;
  const material = new Float32Array(2 * vertices);
  const positions = new Float32Array(3 * vertices * frames);
  for (let v = 0; v < vertices; v++) {
    const [x, y] = [(v % side) / (side - 1), Math.floor(v / side) / (side - 1)];
    material.set([x, y], 2 * v);
    for (let f = 0; f < frames; f++) {
      const wave = 0.08 * Math.sin(9 * x + 5 * y - (2 * Math.PI * f) / 60);
      positions.set([wave * (1 - y), y, x - 0.5], 3 * (f * vertices + v));
    }
  }
  const faces = [];
  for (let row = 0; row + 1 < side; row++) {
    for (let column = 0; column + 1 < side; column++) {
      const a = row * side + column;
      faces.push(a, a + 1, a + side, a + 1, a + side + 1, a + side);
    }
  }
  const tensors = {
    face_area: ["F32", [faces.length / 3], new Float32Array(faces.length / 3).fill(0.5 / (side - 1) ** 2)],
    faces: ["U32", [faces.length / 3, 3], new Uint32Array(faces)],
    handles: ["U32", [2], new Uint32Array([vertices - side, vertices - 1])],
    material_coordinates: ["F32", [vertices, 2], material],
    positions: ["F32", [frames, vertices, 3], positions],
    rest_positions: ["F32", [vertices, 3], positions.slice(0, 3 * vertices)],
    vertex_mass: ["F32", [vertices], new Float32Array(vertices).fill(0.2 / vertices)],
  };
  const header = {
    __metadata__: { format: "selvedge-trajectory", version: "1", fps: "60", scene: "null", made_by: "recording.mjs" },
  };
  let offset = 0;
  for (const [name, [dtype, shape, data]] of Object.entries(tensors)) {
    header[name] = { dtype, shape, data_offsets: [offset, offset + data.byteLength] };
    offset += data.byteLength;
  }
  const text = JSON.stringify(header);
  const padded = text.padEnd(Math.ceil(text.length / 8) * 8);
  const size = Buffer.alloc(8);
  size.writeBigUInt64LE(BigInt(padded.length));
  const parts = Object.values(tensors).map(([, , data]) => Buffer.from(data.buffer));
  writeFileSync(file, Buffer.concat([size, Buffer.from(padded), ...parts]));
}
