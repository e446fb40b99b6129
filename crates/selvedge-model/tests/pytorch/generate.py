"""Writes layers.safetensors: what PyTorch computes for each layer of the network and for whole networks.

    python generate.py        (needs torch, numpy and safetensors from PyPI)

Inputs and weights are random and f32; outputs and gradients are PyTorch's in f64. The gradients are those of
sum(cotangent * output). Prints how far PyTorch's own f32 is from its f64: the noise of f32 itself.
"""

import pathlib
import sys

import torch
from safetensors.torch import save_file
from torch import nn

HERE = pathlib.Path(__file__).resolve().parent
sys.path.append(str(HERE.parents[3] / "docs" / "src" / "python"))
from selvedge_network import Block, GruEncoder, Network, perceptron  # noqa: E402

torch.manual_seed(20231115)
fixture = {}
noise = {}


def numbers(*shape):
    """Random numbers that f32 has."""
    return torch.empty(*shape, dtype=torch.float32).uniform_(-1.0, 1.0)


def shake(module):
    """Weights away from their start, where a LayerNorm does nothing."""
    with torch.no_grad():
        for weight in module.parameters():
            weight += 0.2 * numbers(*weight.shape)


def relative(found, expected):
    return ((found.double() - expected).abs().max() / expected.abs().max()).item()


def run(module, call, inputs, dtype):
    """Outputs, and gradients of inputs and weights by name, in `dtype`."""
    module.zero_grad()
    module.to(dtype)
    inputs = {name: x.clone().to(dtype).requires_grad_() for name, x in inputs.items()}
    outputs = call(module, inputs)
    total = 0
    for name, out in outputs.items():
        if f"cotangent.{name}" in cotangents:
            total = total + (cotangents[f"cotangent.{name}"].to(dtype) * out).sum()
    total.backward()
    gradients = {f"gradient.input.{name}": x.grad for name, x in inputs.items()}
    gradients |= {f"gradient.weight.{name}": w.grad.clone() for name, w in module.named_parameters()}
    return {f"output.{name}": out.detach() for name, out in outputs.items()} | gradients


def case(name, module, call, inputs, judged):
    """Adds a case; `judged` are the shapes of the outputs that the gradients belong to."""
    global cotangents
    shake(module)
    weights = {f"weight.{key}": w.detach().float().clone() for key, w in module.named_parameters()}
    cotangents = {f"cotangent.{key}": numbers(*shape) for key, shape in judged.items()}
    plain = run(module, call, inputs, torch.float32)
    exact = run(module, call, inputs, torch.float64)
    noise[name] = max(relative(plain[key], exact[key]) for key in exact)
    parts = weights | cotangents | {f"input.{key}": x for key, x in inputs.items()} | exact
    fixture.update({f"{name}/{key}": x.detach().contiguous() for key, x in parts.items()})


def strip(columns):
    """Faces of a strip of `columns` x 2 quads."""
    faces = []
    for c in range(columns):
        for row in range(2):
            v = 3 * c + row
            faces += [(v, v + 3, v + 1), (v + 1, v + 3, v + 4)]
    return faces


def arcs_of(faces):
    """Both directions of every edge, in an order of their own."""
    edges = sorted({tuple(sorted((f[k], f[(k + 1) % 3]))) for f in faces for k in range(3)})
    return torch.tensor(edges + [(b, a) for a, b in edges])


faces = strip(2)
arcs = arcs_of(faces)
senders, receivers = arcs[:, 0], arcs[:, 1]
vertices = 9
fixture["faces"] = torch.tensor(faces, dtype=torch.int32)
fixture["arcs"] = arcs.to(torch.int32)

case(
    "layer-norm",
    nn.LayerNorm(9),
    lambda m, x: {"rows": m(x["rows"])},
    {"rows": 3 * numbers(7, 9) + 1},
    {"rows": (7, 9)},
)
case(
    "mlp",
    perceptron(7, 6, 6, norm=True),
    lambda m, x: {"rows": m(x["rows"])},
    {"rows": numbers(8, 7)},
    {"rows": (8, 6)},
)


def gru(module, x):
    states, last = module.gru(x["window"])
    return {"rows": module(x["window"]), "states": states, "last": last}


case("gru", GruEncoder(7, 6), gru, {"window": numbers(4, 8, 7)}, {"rows": (8, 6)})


def block(module, x):
    nodes, edges = module(x["nodes"], x["edges"], senders, receivers)
    return {"nodes": nodes, "edges": edges}


inputs = {"nodes": numbers(vertices, 5), "edges": numbers(len(arcs), 5)}
judged = {"nodes": (vertices, 5), "edges": (len(arcs), 5)}
case("block", Block(5), block, inputs, judged)

# The widths of the paper's features: 16 columns of a vertex, 10 of an arc.
for name, encoder in [
    ("network-gru", {"kind": "gru", "window": 3}),
]:
    window = encoder["window"]
    module = Network({"latent": 6, "blocks": 2, "encoder": encoder}, 16, 10)
    call = lambda m, x: {"rows": m(x["nodes"], x["edges"], senders, receivers)}  # noqa: E731
    inputs = {"nodes": numbers(window, vertices, 16), "edges": numbers(window, len(arcs), 10)}
    case(name, module, call, inputs, {"rows": (vertices, 3)})

path = HERE / "layers.safetensors"
save_file(fixture, path, metadata={"made_by": f"generate.py, torch {torch.__version__}"})
print(f"wrote {path.name}, {path.stat().st_size} bytes; PyTorch's f32 against its f64, largest relative difference:")
for name, worst in noise.items():
    print(f"  {name:12} {worst:.1e}")
