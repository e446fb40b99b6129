"""The networks of Selvedge in PyTorch, for `selvedge bench engine --against "python benches/peer/peer.py"`.

The network is docs/python/selvedge_network.py, plain PyTorch with PyTorch's own kernels. This program reads one line
of JSON (spec, vertices, node_width, edge_width, senders, receivers, threads), answers "ready", and then runs what each
line asks for: "frame", a forward pass without gradients, or "step", a forward pass, the mean square error of the
output, a backward pass and Adam. It answers with the milliseconds that it took.
"""

import json
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "docs" / "python"))

import torch  # noqa: E402
from selvedge_network import Network  # noqa: E402


class Peer:
    def __init__(self, given):
        torch.manual_seed(1)
        torch.set_num_threads(given["threads"])
        spec, vertices, arcs = given["spec"], given["vertices"], len(given["senders"])
        encoder, latent = spec["encoder"], spec["latent"]
        self.network = Network(spec, given["node_width"], given["edge_width"])
        streams = encoder["kind"] == "streaming-gru"
        window = 1 if streams else encoder.get("window", 1)
        edge_window = 1 if encoder["kind"] == "node-gru" else window
        self.nodes = torch.randn(window, vertices, given["node_width"])
        self.edges = torch.randn(edge_window, arcs, given["edge_width"])
        self.senders = torch.tensor(given["senders"])
        self.receivers = torch.tensor(given["receivers"])
        rows = (vertices, arcs) if streams else ()
        self.states = tuple(torch.full((2, count, latent), 0.1) for count in rows) or (None, None)
        self.target = torch.randn(vertices, 3)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=1e-5)

    def forward(self):
        return self.network(self.nodes, self.edges, self.senders, self.receivers, self.states)

    def frame(self):
        with torch.inference_mode():
            self.forward()

    def step(self):
        self.optimizer.zero_grad(set_to_none=True)
        loss = torch.nn.functional.mse_loss(self.forward(), self.target)
        loss.backward()
        self.optimizer.step()


def main():
    peer = Peer(json.loads(sys.stdin.readline()))
    print("ready", flush=True)
    for line in sys.stdin:
        begin = time.perf_counter()
        {"frame": peer.frame, "step": peer.step}[line.strip()]()
        print(1e3 * (time.perf_counter() - begin), flush=True)


if __name__ == "__main__":
    main()
