"""Writes learning.safetensors: the losses of a small cloth with their gradients, the statistics that they are
normalised with, steps of Adam and clipping of a gradient, all by PyTorch in f64.

    python generate.py        (needs torch, numpy and safetensors from PyPI)

The cloth, its frames and the prediction are random; what enters as f32 is f32 here too. The losses are written from
docs/src/reference/equations.md and differentiated by autograd. Prints how far PyTorch's own f32 is from its f64.
"""

import itertools
import pathlib

import torch
from safetensors.torch import save_file

HERE = pathlib.Path(__file__).resolve().parent
COLUMNS, ROWS = 5, 4
HANDLES = [0, 4]
WEIGHTS = {"kinetic_energy": 1.0, "edge_vector": 30.0, "edge_length": 30.0, "bending_angle": 0.5}

torch.manual_seed(5)
fixture = {}


def uniform(*shape):
    return torch.empty(*shape, dtype=torch.float64).uniform_(-1.0, 1.0)


# A grid of quads, each cut along one diagonal or the other, counter-clockwise seen from +x.
faces = []
for r, c in itertools.product(range(ROWS - 1), range(COLUMNS - 1)):
    a, b = r * COLUMNS + c, r * COLUMNS + c + 1
    d, e = a + COLUMNS, b + COLUMNS
    faces += [(a, b, e), (a, e, d)] if (r + c) % 2 else [(a, b, d), (b, e, d)]
vertices = ROWS * COLUMNS
opposite = {}
for f in faces:
    for k in range(3):
        opposite[f[k], f[(k + 1) % 3]] = f[(k + 2) % 3]
edges = sorted({tuple(sorted(pair)) for pair in opposite})
# from, to, left, right: from < to, and from -> to runs counter-clockwise in the left face.
hinges = [(a, b, opposite[a, b], opposite[b, a]) for a, b in edges if (a, b) in opposite and (b, a) in opposite]
ends = torch.tensor(edges)
hinges = torch.tensor(hinges)
free = torch.tensor([v for v in range(vertices) if v not in HANDLES])

flat = torch.tensor([[0.0, -0.2 * r, 0.2 * c] for r in range(ROWS) for c in range(COLUMNS)], dtype=torch.float64)
current = flat + 0.05 * uniform(vertices, 3)
previous = current + 0.02 * uniform(vertices, 3)
target = current + 0.02 * uniform(vertices, 3)
mass = (0.01 + 0.005 * uniform(vertices)).float()
predicted = (1.5 * uniform(vertices, 3)).float()


def energy(next, now, mass):
    return 0.5 * mass * ((next - now) ** 2).sum(-1)


def vectors(p):
    return p[ends[:, 0]] - p[ends[:, 1]]


def angles(p):
    start, end, left, right = (p[hinges[:, k]] for k in range(4))
    e, r = end - start, right - start
    normal_left = torch.linalg.cross(e, left - start)
    normal_right = torch.linalg.cross(r, e)
    sine = -e.norm(dim=-1) * (normal_left * r).sum(-1)
    return torch.atan2(sine, (normal_left * normal_right).sum(-1))


def statistics():
    """Means and (biased) deviations of the target's quantities."""
    d = vectors(target)
    theta = torch.cat([angles(target), torch.zeros(len(edges) - len(hinges), dtype=torch.float64)])
    rows = {
        "acceleration": (target - 2 * current + previous)[free],
        "kinetic_energy": energy(target, current, mass.double())[free, None],
        "edge_vector": torch.cat([d, -d]),
        "edge_length": d.norm(dim=-1)[:, None],
        "bending_angle": theta[:, None],
    }
    return {name: (x.mean(0), x.std(0, correction=0)) for name, x in rows.items()}


def losses(output, stats, dtype):
    """Each term before its weight."""
    q, p, t, m = (x.to(dtype) for x in (previous, current, target, mass))
    stats = {name: (mean.to(dtype), deviation.to(dtype)) for name, (mean, deviation) in stats.items()}
    mean, deviation = stats["acceleration"]
    a = output * deviation + mean
    found = t.clone()
    found[free] = (a + 2 * p - q)[free]
    scaled = lambda name, difference: difference / stats[name][1]  # noqa: E731
    normal = ((t - 2 * p + q) - mean) / deviation
    turn = angles(found) - angles(t)
    shorter = torch.atan2(torch.sin(turn), torch.cos(turn))
    lengths = vectors(found).norm(dim=-1) - vectors(t).norm(dim=-1)
    energies = (energy(found, p, m) - energy(t, p, m))[free]
    return {
        "acceleration": ((output - normal)[free] ** 2).sum(-1).mean(),
        "kinetic_energy": (scaled("kinetic_energy", energies) ** 2).mean(),
        "edge_vector": (scaled("edge_vector", vectors(found) - vectors(t)) ** 2).sum(-1).mean(),
        "edge_length": (scaled("edge_length", lengths) ** 2).mean(),
        "bending_angle": (scaled("bending_angle", shorter) ** 2).sum() / len(edges),
    }


def evaluate(stats, dtype):
    """Values, and the gradient of acceleration + each term alone, and of the weighted sum."""
    out = {}
    for name in [*WEIGHTS, "acceleration", "total"]:
        output = predicted.clone().to(dtype).requires_grad_()
        terms = losses(output, stats, dtype)
        if name == "total":
            value = terms["acceleration"] + sum(w * terms[key] for key, w in WEIGHTS.items())
            objective = value
        elif name == "acceleration":
            value = objective = terms["acceleration"]
        else:
            value = terms[name]
            objective = terms["acceleration"] + value
        objective.backward()
        out[f"loss/{name}"] = value.detach().reshape(1)
        out[f"loss/{name}.gradient"] = output.grad
    return out


def relative(found, expected):
    return ((found.double() - expected).abs().max() / expected.abs().max()).item()


stats = statistics()
exact = evaluate(stats, torch.float64)
plain = evaluate(stats, torch.float32)
fixture |= {
    "faces": torch.tensor(faces, dtype=torch.int32),
    "handles": torch.tensor(HANDLES, dtype=torch.int32),
    "previous": previous,
    "current": current,
    "target": target,
    "mass": mass,
    "predicted": predicted,
}
for name, (mean, deviation) in stats.items():
    fixture |= {f"statistics/{name}.mean": mean, f"statistics/{name}.deviation": deviation}
fixture |= exact

# Adam: gradients of very different size, a rate that changes.
STEPS, COUNT = 40, 30
gradients = (uniform(STEPS, COUNT) * 10.0 ** torch.linspace(-6, 2, COUNT, dtype=torch.float64)).float()
rates = torch.tensor([1e-2 * (1 - k / STEPS) for k in range(STEPS)], dtype=torch.float64)
start = uniform(COUNT).float()


def adam(dtype):
    weights = torch.nn.Parameter(start.to(dtype))
    optimizer = torch.optim.Adam([weights], lr=1.0, betas=(0.9, 0.999), eps=1e-8)
    path = []
    for gradient, rate in zip(gradients, rates):
        optimizer.param_groups[0]["lr"] = rate.item()
        weights.grad = gradient.to(dtype)
        optimizer.step()
        path.append(weights.detach().clone())
    state = optimizer.state[weights]
    return torch.stack(path), state["exp_avg"], state["exp_avg_sq"]


fixture |= {"adam/start": start, "adam/gradients": gradients, "adam/rates": rates}
exact_adam = adam(torch.float64)
fixture |= dict(zip(["adam/weights", "adam/first_moment", "adam/second_moment"], exact_adam))

clipped = torch.nn.Parameter(torch.zeros(COUNT, dtype=torch.float64))
clipped.grad = gradients[0].double()
norm = torch.nn.utils.clip_grad_norm_([clipped], 3.0)
fixture |= {"clip/norm": norm.reshape(1), "clip/gradient": clipped.grad}

path = HERE / "learning.safetensors"
fixture = {name: x.detach().contiguous() for name, x in fixture.items()}
save_file(fixture, path, metadata={"made_by": f"generate.py, torch {torch.__version__}"})
print(f"wrote {path.name}, {path.stat().st_size} bytes; PyTorch's f32 against its f64, largest relative difference:")
for name in exact:
    print(f"  {name:28} {relative(plain[name], exact[name]):.1e}")
plain_adam = adam(torch.float32)
for name, found, expected in zip(["weights", "first moment", "second moment"], plain_adam, exact_adam):
    print(f"  adam {name:23} {relative(found, expected):.1e}")
