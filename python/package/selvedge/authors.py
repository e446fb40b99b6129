"""Checkpoints of the paper's authors as models of Selvedge.

Their training writes four files that begin alike: `_learned_model.pth`, `_node_normalizer.pth`,
`_mesh_edge_normalizer.pth` and `_output_normalizer.pth`, each a whole object that PyTorch pickled.
They are read here without PyTorch, and nothing in them is executed: of an object only its name, its
numbers and its parts are looked at.

Exact: the network (encoder, blocks, decoder), the order of all columns, the statistics, the
integration, the local frame of two handles at one height. What differs, in the sense of their code
first:

- The sign of a bending angle follows the numbering of faces; here it is that of the side to which
  the cloth bends. Nothing can map one to the other: each edge of each mesh has a sign of its own.
- Rest vectors stay in the axes of the world; here they are in the local frame of the rest pose, whose
  z axis leads from the second handle to the first. The weights are turned from one to the other,
  exactly, for the rest pose of the training: by `rest_yaw`.
- Dropout stays on in use, so that a rollout differs from run to run; here there is none. Statistics
  grow until they were used a million times, which the paper's training goes beyond; here they are
  those of the file.
- Air has density 1 and no drag; here it is that of the scene.

A model that is to be used on other meshes should be trained further, with its statistics taken anew:
`selvedge.train(..., start_from=...)` or `selvedge train --from`.
"""

from __future__ import annotations

import io
import pathlib
import pickle
import zipfile
from typing import Any

import numpy as np

from selvedge._native import Model, SelvedgeError, layout

PARTS = ["learned_model", "node_normalizer", "mesh_edge_normalizer", "output_normalizer"]

NODE_FEATURES = ["velocity", "external-force", "kinetic-energy", "node-type"]
EDGE_FEATURES = ["vector", "rest-vector", "elongation", "bending-angle"]

EDGE_COLUMNS = [
    *("vector x", "vector y", "vector z", "length"),
    *("rest vector x", "rest vector y", "rest vector z", "rest length"),
    *("elongation", "bending angle"),
]

# Their code divides by no smaller deviation than this.
LEAST_DEVIATION = 1e-8

TYPES = {
    "FloatStorage": np.float32,
    "DoubleStorage": np.float64,
    "HalfStorage": np.float16,
    "LongStorage": np.int64,
    "IntStorage": np.int32,
    "BoolStorage": np.bool_,
}


class _Object:
    """An object of another program: its parts, and nothing that it does."""

    name = ""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.arguments = arguments
        self.named = named

    def __new__(cls, *arguments: Any, **named: Any) -> "_Object":
        return super().__new__(cls)

    def __setstate__(self, state: Any) -> None:
        self.__dict__.update(state if isinstance(state, dict) else {"state": state})

    # Ordered dictionaries and lists of other programs are filled item by item.
    def __setitem__(self, key: Any, value: Any) -> None:
        self.__dict__.setdefault("items", {})[key] = value


def _tensor(storage: np.ndarray, offset: int, size: tuple, stride: tuple, *_: Any) -> np.ndarray:
    """A tensor over a storage; strides count numbers."""
    reach = offset + sum((n - 1) * s for n, s in zip(size, stride)) if 0 not in size else offset
    if offset < 0 or min(stride, default=0) < 0 or (0 not in size and reach >= len(storage)):
        raise SelvedgeError("a tensor reaches beyond its numbers: the file is damaged")
    step = storage.itemsize
    strided = np.lib.stride_tricks.as_strided
    return strided(storage[offset:], size, [s * step for s in stride]).copy()


class _Reader(pickle.Unpickler):
    """Reads pickles without running anything of them."""

    def __init__(self, archive: zipfile.ZipFile, folder: str) -> None:
        super().__init__(io.BytesIO(archive.read(f"{folder}/data.pkl")))
        self._archive, self._folder = archive, folder
        self._kinds: dict[str, type] = {}

    def find_class(self, module: str, name: str) -> Any:
        known = {
            ("torch._utils", "_rebuild_tensor_v2"): _tensor,
            ("torch._utils", "_rebuild_parameter"): lambda tensor, *_: tensor,
            ("collections", "OrderedDict"): dict,
        }
        if (module, name) in known:
            return known[module, name]
        full = f"{module}.{name}"
        return self._kinds.setdefault(full, type(name, (_Object,), {"name": full}))

    def persistent_load(self, where: Any) -> np.ndarray:
        _, kind, key, *_ = where
        name = getattr(kind, "name", "").rsplit(".", 1)[-1]
        if name not in TYPES:
            raise SelvedgeError(f"numbers of the kind {name} are not known")
        return np.frombuffer(self._archive.read(f"{self._folder}/data/{key}"), TYPES[name])


def _read(path: pathlib.Path) -> Any:
    """The object that PyTorch wrote into `path`."""
    try:
        with zipfile.ZipFile(path) as archive:
            pickles = [name for name in archive.namelist() if name.endswith("/data.pkl")]
            if len(pickles) != 1:
                raise SelvedgeError(f"{path}: this is no file of PyTorch (1.6 or later)")
            return _Reader(archive, pickles[0][: -len("/data.pkl")]).load()
    except SelvedgeError as error:
        raise SelvedgeError(f"{path}: {error}") from error
    except OSError as error:
        raise SelvedgeError(f"{path}: could not be read: {error}") from error
    except Exception as error:
        raise SelvedgeError(f"{path}: this is no file of PyTorch (1.6 or later): {error}") from error


def _weights(module: Any, prefix: str = "") -> dict[str, np.ndarray]:
    """The weights of a module and of its parts, by their paths; those never used are left out."""
    if isinstance(module, dict):
        # A state dict.
        return {k: v for k, v in module.items() if isinstance(v, np.ndarray)}
    found = {}
    for name, weight in getattr(module, "_parameters", {}).items():
        if isinstance(weight, np.ndarray):
            found[prefix + name] = weight
    for name, part in getattr(module, "_modules", {}).items():
        found.update(_weights(part, f"{prefix}{name}."))
    return found


def _perceptron(theirs: str, ours: str, norm: bool = True) -> dict[str, str]:
    """Names of a perceptron, ours by theirs."""
    inner = f"{theirs}.0.layers" if norm else f"{theirs}.layers"
    names = {}
    for kind in ("weight", "bias"):
        for layer in range(3):
            names[f"{inner}.linear_{layer}.{kind}"] = f"{ours}.{2 * layer}.{kind}"
        if norm:
            names[f"{theirs}.1.{kind}"] = f"{ours}.5.{kind}"
    return names


def _recurrent(theirs: str, ours: str) -> dict[str, str]:
    """Names of a recurrent encoder, ours by theirs."""
    names = {}
    for layer in range(2):
        for kind in ("weight_ih", "weight_hh", "bias_ih", "bias_hh"):
            names[f"{theirs}.0.gru.{kind}_l{layer}"] = f"{ours}.gru.{kind}_l{layer}"
    for kind in ("weight", "bias"):
        names[f"{theirs}.0.output_fc.{kind}"] = f"{ours}.linear.{kind}"
        names[f"{theirs}.1.{kind}"] = f"{ours}.norm.{kind}"
    return names


def names(blocks: int, recurrent: bool) -> dict[str, str]:
    """The names of all weights here, by their names in the authors' modules."""
    if recurrent:
        found = _recurrent("encoder.node_mode", "encoder.nodes")
        found |= _recurrent("encoder.mesh_edge_model", "encoder.edges")
    else:
        found = _perceptron("encoder.node_model", "encoder.nodes")
        found |= _perceptron("encoder.mesh_edge_model", "encoder.edges")
    for block in range(blocks):
        part = f"processor.graphnet_blocks.{block}"
        found |= _perceptron(f"{part}.mesh_edge_model", f"processor.{block}.edge")
        found |= _perceptron(f"{part}.node_model", f"processor.{block}.node")
    return found | _perceptron("decoder.model", "decoder", norm=False)


def _statistics(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray]:
    """Mean and deviation of a file of sums, in float64; 0 for a column that was always 0."""
    sums = vars(_read(path))
    try:
        count = max(float(np.ravel(sums["_acc_count"])[0]), 1.0)
        mean = np.asarray(sums["_acc_sum"], np.float64) / count
        square = np.asarray(sums["_acc_sum_squared"], np.float64) / count
    except (KeyError, IndexError, TypeError) as error:
        raise SelvedgeError(f"{path}: the sums of a normaliser are missing: {error}") from error
    deviation = np.sqrt(np.maximum(square - mean**2, 0.0))
    return mean, np.where(square > 0.0, np.maximum(deviation, LEAST_DEVIATION), 0.0)


def _turn_rest_vectors(state: dict[str, np.ndarray], first: str, yaw: float) -> None:
    """Lets the first layer see rest vectors turned by `yaw` about +y, as it saw them before.

    With n = (Q r - m) / s of the file and n' = (r - m') / s' of ours, m' = Qᵀ m and one s' for x and
    z, W n = W diag(1/s) Q diag(s') n'.
    """
    x, z = (EDGE_COLUMNS.index(f"rest vector {axis}") for axis in "xz")
    mean, deviation = (state[f"normalizer.edges.{kind}"].copy() for kind in ("mean", "deviation"))
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    old = deviation[[x, z]]
    new = np.full(2, np.sqrt((old**2).mean()))
    inverse = np.divide(1.0, old, out=np.zeros(2), where=old > 0)
    weight = np.array(state[first], np.float64)
    weight[:, [x, z]] = weight[:, [x, z]] * inverse @ turn * new
    mean[[x, z]] = turn.T @ mean[[x, z]]
    deviation[[x, z]] = new
    state[first] = weight
    state["normalizer.edges.mean"], state["normalizer.edges.deviation"] = mean, deviation


def import_checkpoint(
    prefix: str | pathlib.Path, window: int = 10, rest_yaw: float = 0.0
) -> Model:
    """The model whose files begin with `prefix`, as the authors' training names them.

    Their files do not say `window`, the number of frames that a recurrent encoder sees (10 or 5),
    nor `rest_yaw`, the angle [rad] about +y from +z to the direction from the second handle to the
    first one in the rest pose of the training: 0 where that is +z, pi where it is -z. Raises
    `SelvedgeError`, which names the file and the weight that does not fit.
    """
    files = {part: pathlib.Path(f"{prefix}_{part}.pth") for part in PARTS}
    theirs = _weights(_read(files["learned_model"]))
    recurrent = any(".gru." in name for name in theirs)
    blocks = 1 + max(
        (int(n.split(".")[2]) for n in theirs if n.startswith("processor.graphnet_blocks.")),
        default=-1,
    )
    spec = {
        "node_features": NODE_FEATURES,
        "edge_features": EDGE_FEATURES,
        "encoder": {"kind": "gru", "window": window} if recurrent else {"kind": "mlp", "window": 1},
        "latent": 128,
        "blocks": blocks,
        "integration": {"kind": "inertial"},
    }
    state: dict[str, np.ndarray] = {}
    for name, own in names(blocks, recurrent).items():
        if name not in theirs:
            raise SelvedgeError(f"{files['learned_model']}: the weight {name} is missing")
        state[own] = theirs[name]
    for part, own in zip(PARTS[1:], ["nodes", "edges", "acceleration"]):
        mean, deviation = _statistics(files[part])
        state[f"normalizer.{own}.mean"] = mean
        state[f"normalizer.{own}.deviation"] = deviation
    for name, shape in layout(spec):
        if list(state[name].shape) != shape:
            raise SelvedgeError(
                f"{files['learned_model']}: {name} has the shape {list(state[name].shape)}, and the "
                f"paper's model has {shape}: this checkpoint is of other features or of another width"
            )
    if rest_yaw:
        first = "encoder.edges.gru.weight_ih_l0" if recurrent else "encoder.edges.0.weight"
        _turn_rest_vectors(state, first, rest_yaw)
    training = f"imported from {pathlib.Path(prefix).name} of the paper's authors"
    return Model.from_state_dict(spec, state, training=training, name=str(prefix))
