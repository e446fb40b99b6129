"""A checkpoint in the layout of the paper's authors, imported; one step against their formulas.

The files are written here as PyTorch pickles whole modules, without PyTorch: modules of its names
stand in while they are written. The step is computed by formulas of this file alone, in float64.
Where PyTorch is there, it also writes a file itself, and computes the network.
"""

import collections
import io
import pickle
import sys
import types
import zipfile

import numpy as np
import pytest
import selvedge
from selvedge import authors

WIDTH = 128
SCENE = """
name = "square"
mesh.generator = {{ kind = "square", vertices = 36, size = 1.0, seed = 1 }}
handles.vertices = {handles}
material = "gray-interlock"
motion.named = "forward"
environment = {{ air_density = 1.0, air_drag = 0.0 }}
physics.law = "measured"
"""


class Storage:
    def __init__(self, values):
        self.values = values


class Tensor:
    """A tensor as PyTorch pickles one."""

    def __init__(self, values):
        self.values = np.ascontiguousarray(values, np.float32)

    def __reduce__(self):
        strides = tuple(s // 4 for s in self.values.strides)
        rebuild = sys.modules["torch._utils"]._rebuild_tensor_v2
        empty = collections.OrderedDict()
        shape = self.values.shape
        return rebuild, (Storage(self.values), 0, shape, strides, False, empty)


class Pickler(pickle.Pickler):
    def __init__(self, archive):
        self.bytes = io.BytesIO()
        super().__init__(self.bytes, protocol=2)
        self.archive, self.count = archive, 0

    def persistent_id(self, thing):
        if not isinstance(thing, Storage):
            return None
        key, self.count = str(self.count), self.count + 1
        self.archive.writestr(f"archive/data/{key}", thing.values.tobytes())
        kind = sys.modules["torch"].FloatStorage
        return "storage", kind, key, "cpu", thing.values.size


@pytest.fixture
def pretend(monkeypatch):
    """Modules by the names that the pickles have."""

    def module(name, *contents):
        made = types.ModuleType(name)
        for content in contents:
            content.__module__ = name
            setattr(made, content.__name__, content)
        monkeypatch.setitem(sys.modules, name, made)
        return made

    class FloatStorage:
        pass

    class EncodeProcessDecode:
        pass

    class Normalizer:
        pass

    for kind in (FloatStorage, EncodeProcessDecode, Normalizer):
        kind.__qualname__ = kind.__name__

    def _rebuild_tensor_v2(*_):
        raise AssertionError("nothing of the file is run")

    _rebuild_tensor_v2.__qualname__ = "_rebuild_tensor_v2"
    module("torch", FloatStorage)
    module("torch._utils", _rebuild_tensor_v2)
    module("encode_process_decode", EncodeProcessDecode)
    module("normalization", Normalizer)
    return EncodeProcessDecode, Normalizer


def write(path, thing):
    with zipfile.ZipFile(path, "w") as archive:
        pickler = Pickler(archive)
        pickler.dump(thing)
        archive.writestr("archive/data.pkl", pickler.bytes.getvalue())


def module_of(kind, weights):
    """A tree of modules with these weights."""
    top = kind()
    top.__dict__ |= {"_parameters": collections.OrderedDict(), "_modules": collections.OrderedDict()}
    for path, values in weights.items():
        here = top
        *parts, name = path.split(".")
        for part in parts:
            if part not in here._modules:
                here._modules[part] = module_of(kind, {})
            here = here._modules[part]
        here._parameters[name] = Tensor(values)
    # What is never used has weights without numbers, and is left out.
    top._parameters["unused"] = None
    return top


def random_weights(rng, recurrent, blocks):
    """Weights by the authors' names."""
    weights = {}

    def linear(name, inputs, outputs):
        weights[f"{name}.weight"] = rng.uniform(-1, 1, (outputs, inputs)) / np.sqrt(inputs)
        weights[f"{name}.bias"] = rng.uniform(-0.1, 0.1, outputs)

    def norm(name):
        weights[f"{name}.weight"] = rng.uniform(0.5, 1.5, WIDTH)
        weights[f"{name}.bias"] = rng.uniform(-0.1, 0.1, WIDTH)

    def perceptron(name, inputs, outputs=WIDTH, normed=True):
        inner = f"{name}.0.layers" if normed else f"{name}.layers"
        for layer, (i, o) in enumerate([(inputs, WIDTH), (WIDTH, WIDTH), (WIDTH, outputs)]):
            linear(f"{inner}.linear_{layer}", i, o)
        if normed:
            norm(f"{name}.1")

    for name, old, inputs in [("node_mode", "node_model", 16), ("mesh_edge_model",) * 2 + (10,)]:
        if not recurrent:
            perceptron(f"encoder.{old}", inputs)
            continue
        for layer, i in enumerate([inputs, WIDTH]):
            for kind, width in [("ih", i), ("hh", WIDTH)]:
                bound = 1 / np.sqrt(WIDTH)
                shape = (3 * WIDTH, width)
                gru = f"encoder.{name}.0.gru"
                weights[f"{gru}.weight_{kind}_l{layer}"] = rng.uniform(-bound, bound, shape)
                weights[f"{gru}.bias_{kind}_l{layer}"] = rng.uniform(-bound, bound, 3 * WIDTH)
        linear(f"encoder.{name}.0.output_fc", WIDTH, WIDTH)
        norm(f"encoder.{name}.1")
    for block in range(blocks):
        perceptron(f"processor.graphnet_blocks.{block}.mesh_edge_model", 3 * WIDTH)
        perceptron(f"processor.graphnet_blocks.{block}.node_model", 2 * WIDTH)
    perceptron("decoder.model", WIDTH, 3, normed=False)
    return {name: values.astype(np.float32) for name, values in weights.items()}


def sums_of(kind, mean, deviation, count=4096.0):
    made = kind()
    mean, deviation = np.asarray(mean), np.asarray(deviation)
    made._acc_count = Tensor([count])
    made._acc_sum = Tensor(mean * count)
    made._acc_sum_squared = Tensor((deviation**2 + mean**2) * count)
    return made


def rounded(mean, deviation, count=4096.0):
    """The statistics that the sums of the file give: they are kept in float32."""
    mean, deviation = np.asarray(mean), np.asarray(deviation)
    total = np.float32(mean * count).astype(float) / count
    square = np.float32((deviation**2 + mean**2) * count).astype(float) / count
    return total, np.sqrt(np.maximum(square - total**2, 0))


# The formulas.


def dense(w, name, x):
    return x @ w[f"{name}.weight"].T + w[f"{name}.bias"]


def layer_norm(w, name, x):
    x = x - x.mean(-1, keepdims=True)
    x = x / np.sqrt((x**2).mean(-1, keepdims=True) + 1e-5)
    return x * w[f"{name}.weight"] + w[f"{name}.bias"]


def mlp(w, name, x, normed=True):
    inner = f"{name}.0.layers" if normed else f"{name}.layers"
    for layer in range(3):
        x = dense(w, f"{inner}.linear_{layer}", x)
        x = np.maximum(x, 0) if layer < 2 else x
    return layer_norm(w, f"{name}.1", x) if normed else x


def gru(w, name, frames):
    def sigmoid(x):
        return 1 / (1 + np.exp(-x))

    for layer in range(2):
        state, states = np.zeros((frames.shape[1], WIDTH)), []
        for x in frames:
            a = x @ w[f"{name}.0.gru.weight_ih_l{layer}"].T + w[f"{name}.0.gru.bias_ih_l{layer}"]
            b = state @ w[f"{name}.0.gru.weight_hh_l{layer}"].T + w[f"{name}.0.gru.bias_hh_l{layer}"]
            (ar, az, an), (br, bz, bn) = np.split(a, 3, 1), np.split(b, 3, 1)
            r, z = sigmoid(ar + br), sigmoid(az + bz)
            state = (1 - z) * np.tanh(an + r * bn) + z * state
            states.append(state)
        frames = np.array(states)
    return layer_norm(w, f"{name}.1", dense(w, f"{name}.0.output_fc", frames[-1]))


def network(w, nodes, edges, arcs, recurrent, blocks):
    s, r = arcs.T
    if recurrent:
        v, e = gru(w, "encoder.node_mode", nodes), gru(w, "encoder.mesh_edge_model", edges)
    else:
        v, e = mlp(w, "encoder.node_model", nodes[-1]), mlp(w, "encoder.mesh_edge_model", edges[-1])
    for block in range(blocks):
        part = f"processor.graphnet_blocks.{block}"
        message = mlp(w, f"{part}.mesh_edge_model", np.concatenate([v[s], v[r], e], 1))
        gathered = np.zeros_like(v)
        np.add.at(gathered, r, message)
        v = v + mlp(w, f"{part}.node_model", np.concatenate([v, gathered], 1))
        e = e + message
    return mlp(w, "decoder.model", v, normed=False)


def angles(faces, arcs, p):
    """Dihedral angles, positive for a ridge seen from the side of the normals; 0 at the border."""
    opposite = {}
    for a, b, c in faces:
        opposite |= {(a, b): c, (b, c): a, (c, a): b}
    found = np.zeros(len(arcs))
    for number, (a, b) in enumerate(arcs):
        if (a, b) in opposite and (b, a) in opposite:
            e, left, right = p[b] - p[a], p[opposite[a, b]] - p[a], p[opposite[b, a]] - p[a]
            n, m = np.cross(e, left), np.cross(right, e)
            sine = -np.linalg.norm(e) * (n @ right)
            found[number] = np.arctan2(sine, n @ m)
    return found


def their_step(net, statistics, run, area, frames, goal):
    """The frame after `frames` (window + 1, n, 3), by the paper's formulas and this network."""
    handles, faces, mass = run.handles, run.faces, run.masses.astype(float)
    edges = run.edges
    arcs = np.concatenate([edges, edges[:, ::-1]])
    s, r = arcs.T
    up, along = np.array([0.0, 1, 0]), frames[-1][handles[0]] - frames[-1][handles[1]]
    x = np.cross(up, along)
    x /= np.linalg.norm(x)
    axes = np.array([x, up, np.cross(x, up)])
    local = (frames - frames[-1][handles[0]]) @ axes.T
    rest = run.rest_positions.astype(float)
    # Their rest vectors stay in the axes of the world.
    rest_edge = rest[s] - rest[r]
    rest_length = np.linalg.norm(rest_edge, axis=1, keepdims=True)
    kind = np.zeros((len(mass), 9))
    kind[:, 0] = 1
    kind[handles] = np.eye(9)[1]
    nodes, links = [], []
    for before, now in zip(local, local[1:]):
        v = now - before
        corners = now[faces]
        n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        wind = -run.frame_rate * v[faces].mean(1)
        flow = (n * wind).sum(1, keepdims=True)
        force = mass[:, None] * np.array([0, -9.8, 0])
        for corner in range(3):
            np.add.at(force, faces[:, corner], area[:, None] / 3 * abs(flow) * flow * n)
        energy = 0.5 * mass[:, None] * (v**2).sum(1, keepdims=True)
        nodes.append(np.concatenate([v, force, energy, kind], 1))
        d = now[s] - now[r]
        length = np.linalg.norm(d, axis=1, keepdims=True)
        bend = angles(faces, arcs, now)[:, None]
        links.append(np.concatenate([d, length, rest_edge, rest_length, length - rest_length, bend], 1))

    def scaled(rows, name):
        mean, deviation = statistics[name]
        return (np.array(rows) - mean) / np.maximum(deviation, 1e-8)

    out = net(scaled(nodes, "node"), scaled(links, "edge"), arcs)
    mean, deviation = statistics["output"]
    following = (out * deviation + mean) @ axes + 2 * frames[-1] - frames[-2]
    following[handles] = goal
    return following


STILL = np.r_[np.full(3, 2e-3), np.full(3, 1e-3), 1e-9, 0.2, 0.2, np.zeros(7)]
STATISTICS = {
    "node": (np.r_[np.zeros(4), -0.04, np.zeros(2), 0.95, 0.05, np.zeros(7)], STILL),
    "edge": (
        np.r_[np.zeros(3), 0.2, 0.0, 0, 0, 0.2, 0, 0],
        np.r_[0.05, 0.1, 0.12, 0.05, 0.04, 0.1, 0.13, 0.05, 0.003, 0.3],
    ),
    "output": (np.zeros(3), np.full(3, 5e-4)),
}
NORMALIZERS = [("node", "node"), ("edge", "mesh_edge"), ("output", "output")]


def check_steps(folder, net, window, turned, blocks):
    """Compares six steps of the model in `folder` with those of the formulas."""
    # Vertex 0 is at -z of the other corner.
    corners = [0, 5] if turned else [5, 0]
    scene = selvedge.Scene.parse(SCENE.format(handles=corners))
    yaw = np.pi if turned else 0.0
    model = authors.import_checkpoint(folder / "run", window=window, rest_yaw=yaw)
    assert model.spec["blocks"] == blocks
    run = selvedge.simulate(scene, frames=1)
    p = run.positions[0].astype(float)
    uv = scene.positions[run.faces]
    area = 0.5 * np.linalg.norm(np.cross(uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]), axis=1)
    statistics = {name: rounded(*of) for name, of in STATISTICS.items()}
    stepper = selvedge.LearnedStepper(scene, model)
    frames = [p] * (window + 1)
    worst = moved = 0.0
    for frame in range(1, 7):
        goal = stepper.positions[stepper.handles] + np.array([0.004, 0.0, 0.002 * frame])
        expected = their_step(net, statistics, run, area, np.array(frames), goal)
        found = stepper.step(goal).astype(float)
        worst = max(worst, abs(found - expected).max())
        moved = max(moved, abs(found - frames[-1]).max())
        frames = frames[1:] + [found]
    print(f"largest difference of a coordinate {worst:.1e} m, largest move {moved:.1e} m")
    # Positions up to 1 m are exact to 0.6e-7 m in float32, and 2 p - q rounds twice.
    assert worst < 2e-7 and moved > 1e-3


@pytest.mark.parametrize("recurrent", [True, False], ids=["gru", "mlp"])
@pytest.mark.parametrize("turned", [False, True], ids=["ahead", "turned"])
def test_one_step_is_that_of_their_formulas(pretend, tmp_path, recurrent, turned):
    kind, normalizer = pretend
    blocks, window = 3, 5 if recurrent else 1
    weights = random_weights(np.random.default_rng(1), recurrent, blocks)
    write(tmp_path / "run_learned_model.pth", module_of(kind, weights))
    for name, part in NORMALIZERS:
        write(tmp_path / f"run_{part}_normalizer.pth", sums_of(normalizer, *STATISTICS[name]))

    def net(nodes, edges, arcs):
        return network(weights, nodes, edges, arcs, recurrent, blocks)

    check_steps(tmp_path, net, window, turned, blocks)


@pytest.mark.parametrize("recurrent", [True, False], ids=["gru", "mlp"])
def test_one_step_is_that_of_pytorch(tmp_path, recurrent):
    """Modules of PyTorch, written by it and computed by it, in float64."""
    torch = pytest.importorskip("torch", reason="PyTorch is not here")
    nn = torch.nn
    torch.manual_seed(1)
    blocks, window = 2, 5 if recurrent else 1

    def tree(**parts):
        made = nn.Module()
        for name, part in parts.items():
            setattr(made, name, part)
        return made

    def perceptron(inputs, outputs=WIDTH, normed=True):
        layers = collections.OrderedDict()
        for layer, (i, o) in enumerate([(inputs, WIDTH), (WIDTH, WIDTH), (WIDTH, outputs)]):
            layers[f"linear_{layer}"] = nn.Linear(i, o)
            if layer < 2:
                layers[f"relu_{layer}"] = nn.ReLU()
        made = tree(layers=nn.Sequential(layers))
        return nn.Sequential(made, nn.LayerNorm(WIDTH)) if normed else made

    def encoder(inputs):
        if not recurrent:
            return perceptron(inputs)
        gru = nn.GRU(inputs, WIDTH, num_layers=2, dropout=0.2)
        return nn.Sequential(tree(gru=gru, output_fc=nn.Linear(WIDTH, WIDTH)), nn.LayerNorm(WIDTH))

    def block():
        # What is never used stays without a shape.
        return tree(
            mesh_edge_model=perceptron(3 * WIDTH),
            node_model=perceptron(2 * WIDTH),
            world_edge_model=nn.LazyLinear(WIDTH),
        )

    node_name = "node_mode" if recurrent else "node_model"
    model = tree(
        encoder=tree(**{node_name: encoder(16), "mesh_edge_model": encoder(10)}),
        processor=tree(graphnet_blocks=nn.ModuleList([block() for _ in range(blocks)])),
        decoder=tree(model=perceptron(WIDTH, 3, normed=False)),
    )
    torch.save(model, tmp_path / "run_learned_model.pth")
    for name, part in NORMALIZERS:
        mean, deviation = STATISTICS[name]
        sums = tree()
        for key, value in [("", mean), ("_squared", deviation**2 + mean**2)]:
            setattr(sums, f"_acc_sum{key}", torch.tensor(4096.0 * value, dtype=torch.float32))
        sums._acc_count = torch.tensor([4096.0])
        torch.save(sums, tmp_path / f"run_{part}_normalizer.pth")
    model = model.double().eval()

    def of(part, x):
        inner = part[0] if isinstance(part, nn.Sequential) else part
        if hasattr(inner, "gru"):
            x = inner.output_fc(inner.gru(x)[0][-1])
        else:
            x = inner.layers(x)
        return part[1](x) if isinstance(part, nn.Sequential) else x

    def net(nodes, edges, arcs):
        s, r = torch.tensor(arcs.T.astype(np.int64))
        nodes, edges = (torch.tensor(x if recurrent else x[-1]) for x in (nodes, edges))
        with torch.no_grad():
            v = of(getattr(model.encoder, node_name), nodes)
            e = of(model.encoder.mesh_edge_model, edges)
            for part in model.processor.graphnet_blocks:
                message = of(part.mesh_edge_model, torch.cat([v[s], v[r], e], 1))
                gathered = torch.zeros_like(v).index_add_(0, r, message)
                v = v + of(part.node_model, torch.cat([v, gathered], 1))
                e = e + message
            return of(model.decoder.model, v).numpy()

    check_steps(tmp_path, net, window, turned=False, blocks=blocks)


def test_damaged_and_foreign_files_are_refused(pretend, tmp_path):
    kind, normalizer = pretend
    weights = random_weights(np.random.default_rng(2), False, 1)
    write(tmp_path / "run_learned_model.pth", module_of(kind, weights))
    with pytest.raises(selvedge.SelvedgeError, match="run_node_normalizer.pth: could not be read"):
        authors.import_checkpoint(tmp_path / "run")
    for part, width in [("node", 16), ("mesh_edge", 10), ("output", 3)]:
        sums = sums_of(normalizer, np.zeros(width), np.ones(width))
        write(tmp_path / f"run_{part}_normalizer.pth", sums)
    assert authors.import_checkpoint(tmp_path / "run").spec["encoder"]["kind"] == "mlp"
    lacking = {k: v for k, v in weights.items() if k != "decoder.model.layers.linear_2.bias"}
    write(tmp_path / "run_learned_model.pth", module_of(kind, lacking))
    with pytest.raises(selvedge.SelvedgeError, match="linear_2.bias is missing"):
        authors.import_checkpoint(tmp_path / "run")
    (tmp_path / "run_learned_model.pth").write_bytes(b"not a checkpoint")
    with pytest.raises(selvedge.SelvedgeError, match="no file of PyTorch"):
        authors.import_checkpoint(tmp_path / "run")


def test_nothing_of_a_file_is_run(tmp_path):
    class Evil:
        def __reduce__(self):
            return exec, (f"open({str(tmp_path / 'run')!r}, 'w')",)

    write(tmp_path / "evil_learned_model.pth", Evil())
    with pytest.raises(selvedge.SelvedgeError):
        authors.import_checkpoint(tmp_path / "evil")
    assert not (tmp_path / "run").exists()
