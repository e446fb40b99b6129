// A picture and a clip of what is seen, saved by the browser.

export function savePicture(canvas: HTMLCanvasElement, draw: () => void): void {
  // Drawn and read in one go: a canvas forgets what it showed.
  draw();
  canvas.toBlob((blob) => blob && save(blob, dated("png")), "image/png");
}

export class Clip {
  private recorder: MediaRecorder | null = null;

  constructor(private readonly canvas: HTMLCanvasElement) {}

  get isOn(): boolean {
    return this.recorder !== null;
  }

  static get isPossible(): boolean {
    return "MediaRecorder" in window && "captureStream" in HTMLCanvasElement.prototype;
  }

  start(): void {
    const types = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];
    const mimeType = types.find((type) => MediaRecorder.isTypeSupported(type));
    const stream = this.canvas.captureStream(60);
    const recorder = new MediaRecorder(stream, { ...(mimeType ? { mimeType } : {}), videoBitsPerSecond: 12e6 });
    const parts: Blob[] = [];
    recorder.ondataavailable = (event) => parts.push(event.data);
    recorder.onstop = () => {
      stream.getTracks().forEach((track) => track.stop());
      save(new Blob(parts, { type: recorder.mimeType }), dated(recorder.mimeType.includes("mp4") ? "mp4" : "webm"));
    };
    recorder.start();
    this.recorder = recorder;
  }

  stop(): void {
    this.recorder?.stop();
    this.recorder = null;
  }
}

function dated(extension: string): string {
  return `selvedge-${new Date().toISOString().slice(0, 19).replaceAll(":", "")}.${extension}`;
}

export function save(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
