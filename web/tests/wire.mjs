// Measures the session without a browser, over its socket:
// node --experimental-websocket tests/wire.mjs
// From the start of the program to the first frame; from a drag that is sent to the frame that
// follows it; frames per second of the shipped model on 400 vertices; frames per second of 10,000
// recorded vertices.
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { start } from "./browser.mjs";
import { writeRecording } from "./recording.mjs";

const sleep = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));
const median = (numbers) => numbers.toSorted((a, b) => a - b)[Math.floor(numbers.length / 2)];

function message(kind, ...parts) {
  return Buffer.concat([Buffer.from([3, kind, 0, 0]), ...parts]);
}

function words(...numbers) {
  const bytes = Buffer.alloc(4 * numbers.length);
  numbers.forEach((number, k) => bytes.writeUInt32LE(number, 4 * k));
  return bytes;
}

/** A client that takes up every frame. */
async function client(url) {
  const socket = new WebSocket(url.replace("http", "ws") + "socket", "selvedge.v3");
  socket.binaryType = "arraybuffer";
  const now = { frames: 0, state: null, onFrame: () => undefined };
  socket.onmessage = ({ data }) => {
    const bytes = Buffer.from(data);
    if (bytes[1] === 3) now.state = JSON.parse(bytes.subarray(4).toString());
    if (bytes[1] !== 4) return;
    socket.send(message(16, bytes.subarray(8, 12)));
    now.frames += 1;
    now.frame = bytes;
    now.onFrame(bytes);
  };
  await new Promise((resolve, reject) => {
    socket.onopen = resolve;
    socket.onerror = reject;
  });
  const until = async (check) => {
    while (!check()) await sleep(0.002);
  };
  const command = (what) => socket.send(message(19, Buffer.from(JSON.stringify(what))));
  return { socket, now, until, command };
}

/** Frames per second over `seconds`. */
async function rate(now, seconds) {
  const [frames, at] = [now.frames, performance.now()];
  await sleep(seconds);
  return (1000 * (now.frames - frames)) / (performance.now() - at);
}

async function startTime() {
  const times = [];
  for (let k = 0; k < 5; k++) {
    const served = await start(["--show", "model"]);
    const { socket, now, until } = await client(served.url);
    await until(() => now.frames > 1);
    times.push((performance.now() - served.began) / 1000);
    socket.close();
    await served.stop();
  }
  return { runs: times.length, median_s: median(times), most_s: Math.max(...times) };
}

async function drags() {
  const served = await start(["--show", "model"]);
  const { socket, now, until, command } = await client(served.url);
  await until(() => now.state && now.frames > 0);
  const order = { ...now.state.order, mesh: { name: "square", vertices: 400 } };
  command({ do: "order", order });
  await until(() => now.state.order.mesh?.vertices === 400 && !now.state.busy);
  const [vertex, handles] = [now.frame.readUInt32LE(44), now.frame.readUInt32LE(24)];
  const home = [0, 1, 2].map((k) => now.frame.readFloatLE(48 + 4 * k));
  const sent = new Map();
  const latencies = [];
  now.onFrame = (frame) => {
    const number = frame.readUInt32LE(20);
    if (sent.has(number)) latencies.push(performance.now() - sent.get(number));
    sent.delete(number);
  };
  const kept = rate(now, 10);
  for (let k = 1; k <= 500; k++) {
    const goal = Buffer.alloc(12);
    const circle = [0, 0.1 * Math.cos(k / 10), 0.1 * Math.sin(k / 10)];
    home.forEach((place, axis) => goal.writeFloatLE(place + circle[axis], 4 * axis));
    sent.set(k, performance.now());
    socket.send(message(17, words(k, 1, vertex), goal));
    // At no fixed time within a frame.
    await sleep(0.013 + 0.01 * Math.random());
  }
  const answer = {
    vertices: (now.frame.length - 44 - 16 * handles) / 12,
    step_ms: now.state.tracks[0].step_ms,
    drags_followed: latencies.length,
    median_ms: median(latencies),
    frames_per_second: await kept,
  };
  socket.close();
  await served.stop();
  return answer;
}

/** A ball thrown into a hanging sheet of 400 vertices again and again, its sides by turns. */
async function throws() {
  const served = await start(["--show", "physics"]);
  const { socket, now, until, command } = await client(served.url);
  await until(() => now.state && now.frames > 0);
  const order = { ...now.state.order, mesh: { name: "square", vertices: 400 }, touches: true };
  command({ do: "order", order });
  await until(() => now.state.touches && now.state.order.mesh?.vertices === 400 && !now.state.busy);
  const steps = [];
  now.onFrame = () => steps.push(now.state.tracks[0].step_ms);
  const kept = rate(now, 12);
  for (let k = 0; k < 6; k++) {
    const side = k % 2 === 0 ? 1 : -1;
    command({ do: "throw", from: [1.2 * side, -0.5, 0.1 * (k - 2.5)], velocity: [-5 * side, 1.2, 0] });
    await sleep(2);
  }
  const answer = {
    vertices: 400,
    step_ms: median(steps),
    most_ms: Math.max(...steps),
    stopped: now.state.tracks[0].stopped,
    frames_per_second: await kept,
  };
  socket.close();
  await served.stop();
  return answer;
}

async function playback() {
  const folder = mkdtempSync(join(tmpdir(), "selvedge-recording-"));
  const file = join(folder, "wave.safetensors");
  writeRecording(file, 100, 240);
  const served = await start([file]);
  const { socket, now, until } = await client(served.url);
  await until(() => now.frames > 0);
  const answer = { vertices: 10_000, frames_per_second: await rate(now, 10) };
  socket.close();
  await served.stop();
  rmSync(folder, { recursive: true });
  return answer;
}

const load = () => readFileSync("/proc/loadavg", "utf8").split(" ")[0];
console.log("load", load());
console.log("start", await startTime());
console.log("drag", await drags());
console.log("throw", await throws());
console.log("playback", await playback());
console.log("load", load());
