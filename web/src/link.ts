// The socket to the session: opened again when it is lost, and slower each time it fails.

import * as protocol from "./protocol";

export type LinkStatus = "connecting" | "open" | "lost" | "refused";

export class Link {
  private socket: WebSocket | null = null;
  private failures = 0;

  constructor(
    private readonly onMessage: (message: protocol.Message) => void,
    private readonly onStatus: (status: LinkStatus, reason: string) => void,
  ) {
    this.open();
  }

  send(bytes: ArrayBuffer): void {
    if (this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(bytes);
    }
  }

  command(command: protocol.Command): void {
    this.send(protocol.command(command));
  }

  private open(): void {
    this.onStatus("connecting", "");
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`, protocol.SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.failures = 0;
      this.onStatus("open", "");
    };
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => {
      let message: protocol.Message;
      try {
        message = protocol.decode(event.data);
      } catch (error) {
        this.onStatus("refused", String(error));
        return;
      }
      if (message.kind === "frame") {
        // Says that this page keeps up; without it the session sends no more.
        this.send(protocol.ready(message.frame.number));
      }
      this.onMessage(message);
    };
    socket.onclose = (event) => {
      this.failures += 1;
      // 1002 and 1003: what this page says is not understood; saying it again helps nobody.
      const refused = event.code === 1002 || event.code === 1003;
      this.onStatus(refused ? "refused" : "lost", event.reason);
      if (!refused) {
        setTimeout(() => this.open(), Math.min(250 * this.failures, 2000));
      }
    };
  }
}
