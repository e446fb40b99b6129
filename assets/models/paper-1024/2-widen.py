"""Widens a network of 64 by 8 blocks with a recurrent encoder to 128 by 15, which computes the same.

    pip install numpy safetensors
    python3 assets/models/paper-1024/2-widen.py narrow.safetensors wide.safetensors

Latents stand twice; what reads them has two weights that add up to the old one, apart by a random number, so that both
halves learn. Hidden units are added with no reader, and after each block but the last a new one whose normalisation
has the gain 0 (Net2Net, Chen et al. 2016).
"""

import json
import sys

import numpy as np
from safetensors import safe_open
from safetensors.numpy import save_file

OLD, NEW, BLOCKS = 64, 128, 15
EXTRA = NEW - OLD
rng = np.random.default_rng(7)


def uniform(*shape, inputs=NEW):
    return rng.uniform(-1, 1, shape) / np.sqrt(inputs)


def halves(weight):
    """Columns of a reader of one latent: two that add up."""
    apart = rng.normal(0, 0.3 * weight.std(), weight.shape)
    return np.concatenate([weight / 2 + apart, weight / 2 - apart], 1)


def unread(weight):
    """Columns of 0 for new hidden units."""
    return np.pad(weight, ((0, 0), (0, EXTRA)))


def twice(array):
    return np.concatenate([array, array])


def perceptron(old, at, new, to, latents, norm):
    """Three layers that read `latents` latents; with `norm` the last writes one."""
    first = old[f"{at}.0.weight"]
    first = np.concatenate([halves(first[:, k * OLD : (k + 1) * OLD]) for k in range(latents)], 1)
    for layer, weight in (("0", first), ("2", unread(old[f"{at}.2.weight"]))):
        inputs = weight.shape[1]
        new[f"{to}.{layer}.weight"] = np.concatenate([weight, uniform(EXTRA, inputs, inputs=inputs)])
        new[f"{to}.{layer}.bias"] = np.concatenate([old[f"{at}.{layer}.bias"], uniform(EXTRA, inputs=inputs)])
    last, bias = unread(old[f"{at}.4.weight"]), old[f"{at}.4.bias"]
    new[f"{to}.4.weight"], new[f"{to}.4.bias"] = (twice(last), twice(bias)) if norm else (last, bias)
    if norm:
        new |= {f"{to}.5.{name}": twice(old[f"{at}.5.{name}"]) for name in ("weight", "bias")}
    return new


def identity(new, to, latents):
    """Three new layers whose output is 0."""
    for layer, inputs in (("0", latents * NEW), ("2", NEW), ("4", NEW)):
        new[f"{to}.{layer}.weight"] = uniform(NEW, inputs, inputs=inputs)
        new[f"{to}.{layer}.bias"] = uniform(NEW, inputs=inputs)
    return new | {f"{to}.5.{name}": np.zeros(NEW) for name in ("weight", "bias")}


def recurrent(old, at, new):
    """Two layers of gated recurrent units, a linear one and a normalisation."""
    for layer in range(2):
        for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh"):
            key, gates = f"{at}.gru.{name}_l{layer}", []
            for gate in np.split(old[key], 3):
                if gate.ndim == 2:
                    gate = gate if (name, layer) == ("weight_ih", 0) else unread(gate)
                gates += [gate, uniform(EXTRA, *gate.shape[1:])]
            new[key] = np.concatenate(gates)
    new[f"{at}.linear.weight"] = twice(unread(old[f"{at}.linear.weight"]))
    for name in ("linear.bias", "norm.weight", "norm.bias"):
        new[f"{at}.{name}"] = twice(old[f"{at}.{name}"])
    return new


def main(source, target):
    with safe_open(source, "np") as file:
        old = {key: file.get_tensor(key) for key in file.keys()}
        spec = json.loads(file.metadata()["spec"]) | {"latent": NEW, "blocks": BLOCKS}
        metadata = file.metadata() | {"spec": json.dumps(spec, separators=(",", ":"))}
    metadata.pop("training", None)
    narrow = {key: array.astype(np.float64) for key, array in old.items()}
    new = perceptron(narrow, "decoder", {}, "decoder", 1, norm=False)
    for of in ("nodes", "edges"):
        new = recurrent(narrow, f"encoder.{of}", new)
    for block in range(BLOCKS):
        for of, latents in (("edge", 3), ("node", 2)):
            to = f"processor.{block}.{of}"
            if block % 2:
                new = identity(new, to, latents)
            else:
                new = perceptron(narrow, f"processor.{block // 2}.{of}", new, to, latents, norm=True)
    kept = {key: array for key, array in old.items() if key.startswith("normalizer")}
    save_file({key: array.astype(np.float32) for key, array in new.items()} | kept, target, metadata)


if __name__ == "__main__":
    main(*sys.argv[1:])
