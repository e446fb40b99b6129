"""The networks of Selvedge in PyTorch, for `cargo bench -p selvedge-lab --bench networks -- against=...`.

The network is docs/src/python/selvedge_network.py, plain PyTorch with PyTorch's own kernels. This program reads one line
of JSON (spec, vertices, node_width, edge_width, senders, receivers, threads), answers "ready", and then runs what each
line asks for: "frame", a forward pass without gradients, or "step", a forward pass, the mean square error of the
output, a backward pass and Adam. It answers with the milliseconds that it took.

Options: --device cuda runs it on a GPU, --compile by torch.compile (CUDA graphs where there is a GPU; recurrent units
are part of the graph where PyTorch has torch._dynamo.config.allow_rnn), --precision
tensor with products in TF32, half with what PyTorch's autocast does in bfloat16. A GPU is waited for before and after
what is timed.
"""

import argparse
import json
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "docs" / "src" / "python"))

import torch  # noqa: E402
import torch._dynamo  # noqa: E402
from selvedge_network import Network  # noqa: E402


class Peer:
    def __init__(self, given, options):
        torch.manual_seed(1)
        torch.set_num_threads(given["threads"])
        torch.set_float32_matmul_precision("high" if options.precision == "tensor" else "highest")
        torch.set_default_device(options.device)
        self.on_gpu = options.device.startswith("cuda")
        self.marks_runs = self.on_gpu and options.compile
        kind, in_half = torch.device(options.device).type, options.precision == "half"
        self.precision = lambda: torch.autocast(kind, dtype=torch.bfloat16, enabled=in_half)
        torch.backends.cudnn.allow_tf32 = options.precision == "tensor"
        spec, vertices, arcs = given["spec"], given["vertices"], len(given["senders"])
        self.network = Network(spec, given["node_width"], given["edge_width"])
        window = spec["encoder"].get("window", 1)
        self.nodes = torch.randn(window, vertices, given["node_width"])
        self.edges = torch.randn(window, arcs, given["edge_width"])
        self.senders = torch.tensor(given["senders"])
        self.receivers = torch.tensor(given["receivers"])
        self.target = torch.randn(vertices, 3)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=1e-5)
        if options.compile and hasattr(torch._dynamo.config, "allow_rnn"):
            # Without it the graph breaks at every recurrent unit.
            torch._dynamo.config.allow_rnn = True
        mode = "reduce-overhead" if self.on_gpu else "default"
        self.run = torch.compile(self.network, mode=mode) if options.compile else self.network
        self.without_gradients = torch.no_grad if options.compile else torch.inference_mode

    def forward(self):
        if self.marks_runs:
            # What the graphs of the run before have left is not wanted any more.
            torch.compiler.cudagraph_mark_step_begin()
        with self.precision():
            return self.run(self.nodes, self.edges, self.senders, self.receivers)

    def wait(self):
        if self.on_gpu:
            torch.cuda.synchronize()

    def frame(self):
        with self.without_gradients():
            self.forward()

    def step(self):
        self.optimizer.zero_grad(set_to_none=True)
        loss = torch.nn.functional.mse_loss(self.forward().float(), self.target)
        loss.backward()
        self.optimizer.step()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--precision", choices=["full", "tensor", "half"], default="full")
    peer = Peer(json.loads(sys.stdin.readline()), parser.parse_args())
    print("ready", flush=True)
    for line in sys.stdin:
        peer.wait()
        begin = time.perf_counter()
        {"frame": peer.frame, "step": peer.step}[line.strip()]()
        peer.wait()
        print(1e3 * (time.perf_counter() - begin), flush=True)


if __name__ == "__main__":
    main()
