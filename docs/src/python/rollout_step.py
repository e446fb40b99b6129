"""Runs a Selvedge model in PyTorch, one step from every frame of a rollout, and compares it with what Selvedge made.

    selvedge run --model paper --guard none --no-clip --frames 120 -o out
    python rollout_step.py assets/models/paper.safetensors out/rollout.safetensors

Needs torch, numpy and safetensors from PyPI. From each frame (and those before it that the model looks at) the next
one is predicted with features, network and integration written here anew, after docs/src/reference/equations.md, for whatever the
spec in the model file asks for, and compared with the next frame of the file. Handles are taken from the file: they
are given.
"""

import argparse
import json

import numpy as np
import torch
from safetensors import safe_open

from selvedge_network import Network

NODE_FEATURES = ["velocity", "external-force", "kinetic-energy", "node-type"]
KEYS = {"node_features", "edge_features", "encoder", "latent", "blocks", "integration"}
EDGE_FEATURES = ["vector", "rest-vector", "material-vector", "elongation", "bending-angle"]


def read(path):
    with safe_open(path, framework="np") as file:
        return {name: file.get_tensor(name) for name in file.keys()}, file.metadata()


def turn_of(angle):
    """The matrix that turns columns about +y: local axes to world axes for the yaw of a local frame."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])


def horizontal(positions):
    """z + i x, about the centroid."""
    complex_numbers = positions[:, 2] + 1j * positions[:, 0]
    return complex_numbers - complex_numbers.mean() if len(positions) else complex_numbers


class Cloth:
    """A trajectory's cloth: connectivity, masses, rest pose, and the local frame that follows its handles."""

    def __init__(self, arrays, metadata):
        wide = {name: x.astype(np.float64) for name, x in arrays.items() if x.dtype == np.float32}
        self.frames, self.rest = wide["positions"], wide["rest_positions"]
        self.material, self.mass = wide["material_coordinates"], wide["vertex_mass"]
        self.area, self.handles = wide["face_area"], arrays["handles"].astype(int)
        self.faces = arrays["faces"].astype(int)
        self.rate = float(metadata["fps"])
        scene = json.loads(metadata["scene"])
        setting = (scene or {}).get("setting", {})
        self.environment = setting["environment"]
        opposite = {}
        for a, b, c in self.faces:
            opposite |= {(a, b): c, (b, c): a, (c, a): b}
        edges = sorted({tuple(sorted(pair)) for pair in opposite})
        self.arcs = np.array(edges + [(b, a) for a, b in edges])
        hinges = [(k, a, b, opposite[a, b], opposite[b, a]) for k, (a, b) in enumerate(edges)
                  if (a, b) in opposite and (b, a) in opposite]
        self.hinge_edges, self.hinges = np.array(hinges)[:, 0], np.array(hinges)[:, 1:]
        self.edge_count = len(edges)
        self.at_rest = horizontal(self.rest[self.handles])
        self.rest_yaw = self.direction_at_rest()

    def direction_at_rest(self):
        """The principal axis of the handles, signed like first - last; 0 where they have no horizontal direction."""
        spread = (abs(self.at_rest) ** 2).sum()
        rest = self.rest[self.handles]
        whole = ((rest - rest.mean(0)) ** 2).sum() if len(rest) else 0.0
        if spread <= 1e-6 * whole or spread == 0.0:
            self.at_rest = self.at_rest * 0.0
            return 0.0
        squares = (self.at_rest**2).sum()
        if abs(squares) <= 1e-3 * spread:
            ends = self.at_rest[0] - self.at_rest[-1]
            return np.angle(ends if abs(ends) > 1e-3 * np.sqrt(spread) else self.at_rest[0])
        axis = np.exp(0.5j * np.angle(squares))
        for a in [self.at_rest[0] - self.at_rest[-1], *self.at_rest]:
            along = (a * axis.conjugate()).real
            if abs(along) > 1e-3 * np.sqrt(spread):
                return np.angle(np.sign(along) * axis)
        return 0.0

    def yaw(self, handles):
        """That of the rest pose, turned as the handles have turned since."""
        turn = (self.at_rest.conjugate() * horizontal(handles)).sum()
        spread = (abs(self.at_rest) ** 2).sum()
        turned = abs(turn) > 1e-3 * spread and spread > 0.0
        return self.rest_yaw + (np.angle(turn) if turned else 0.0)


def external_force(cloth, previous, current):
    env = cloth.environment
    force = cloth.mass[:, None] * np.array(env["gravity"])
    corners = current[cloth.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    velocity = cloth.rate * (corners - previous[cloth.faces]).mean(1)
    relative = np.array(env["wind"]) - velocity
    along = (normal * relative).sum(1, keepdims=True)
    tangential = relative - along * normal
    drag = env["air_density"] * abs(along) * along * normal + env["air_drag"] * tangential
    for k in range(3):
        np.add.at(force, cloth.faces[:, k], cloth.area[:, None] / 3 * drag)
    return force


def bending_angle(cloth, positions):
    """Of every edge; 0 on the boundary [eq:bending-angle]."""
    start, end, left, right = (positions[cloth.hinges[:, k]] for k in range(4))
    e, r = end - start, right - start
    normal_left, normal_right = np.cross(e, left - start), np.cross(r, e)
    sine = 0.0 - np.linalg.norm(e, axis=1) * (normal_left * r).sum(1)
    angles = np.zeros(cloth.edge_count)
    angles[cloth.hinge_edges] = np.arctan2(sine, (normal_left * normal_right).sum(1))
    return angles


def with_length(d):
    return np.concatenate([d, np.linalg.norm(d, axis=1, keepdims=True)], axis=1)


def node_columns(spec, cloth, frames, number, yaw):
    """Columns of every vertex in frame `number` of the window's history."""
    local = lambda d: d @ turn_of(yaw)  # noqa: E731
    previous, current = frames[number - 1], frames[number]
    kind = np.zeros((len(current), 9))
    kind[:, 0] = 1.0
    kind[cloth.handles] = np.eye(9)[1]

    make = {
        "velocity": lambda: local(current - previous),
        "external-force": lambda: local(external_force(cloth, previous, current)),
        "kinetic-energy": lambda: (0.5 * cloth.mass * ((current - previous) ** 2).sum(1))[:, None],
        "node-type": lambda: kind,
    }
    return np.concatenate([make[name]() for name in NODE_FEATURES if name in spec["node_features"]], axis=1)


def edge_columns(spec, cloth, positions, yaw):
    """Columns of every arc."""
    senders, receivers = cloth.arcs.T
    rest = cloth.rest[senders] - cloth.rest[receivers]
    d = positions[senders] - positions[receivers]
    longer = np.linalg.norm(d, axis=1) - np.linalg.norm(rest, axis=1)
    make = {
        "vector": lambda: with_length(d @ turn_of(yaw)),
        "rest-vector": lambda: with_length(rest @ turn_of(cloth.rest_yaw)),
        "material-vector": lambda: with_length(cloth.material[senders] - cloth.material[receivers]),
        "elongation": lambda: longer[:, None],
        "bending-angle": lambda: np.tile(bending_angle(cloth, positions), 2)[:, None],
    }
    return np.concatenate([make[name]() for name in EDGE_FEATURES if name in spec["edge_features"]], axis=1)


class Model:
    """A model file as PyTorch sees it: a spec, normalisers and a network."""

    def __init__(self, path):
        arrays, metadata = read(path)
        self.spec = json.loads(metadata["spec"])
        for list_name, known in [("node_features", NODE_FEATURES), ("edge_features", EDGE_FEATURES)]:
            unknown = set(self.spec[list_name]) - set(known)
            unknown |= set(self.spec) - KEYS
            if unknown:
                raise SystemExit(f"{path}: this script does not know {sorted(unknown)} of the spec")
        self.statistics = {
            name: tuple(arrays.pop(f"normalizer.{name}.{kind}") for kind in ("mean", "deviation"))
            for name in ("nodes", "edges", "acceleration")
        }
        widths = (len(self.statistics[name][0]) for name in ("nodes", "edges"))
        self.network = Network(self.spec, *widths)
        self.network.load_state_dict({name: torch.from_numpy(x) for name, x in arrays.items()})
        self.network.eval()

    def history(self):
        return self.spec["encoder"].get("window", 1) + 1

    def normalised(self, name, rows):
        mean, deviation = self.statistics[name]
        scale = np.divide(1.0, deviation, out=np.zeros_like(deviation), where=deviation > 0)
        return torch.from_numpy(((rows - mean) * scale).astype(np.float32))

    def step(self, cloth, frames, next_handles):
        """The frame after `frames` (as many as `history`, oldest first)."""
        current, previous = frames[-1], frames[-2]
        yaw = cloth.yaw(current[cloth.handles])
        window = range(len(frames) - self.spec["encoder"].get("window", 1), len(frames))
        nodes = [node_columns(self.spec, cloth, frames, k, yaw) for k in window]
        edges = [edge_columns(self.spec, cloth, frames[k], yaw) for k in window]
        nodes, edges = self.normalised("nodes", np.array(nodes)), self.normalised("edges", np.array(edges))
        senders, receivers = torch.from_numpy(cloth.arcs.T.copy())
        with torch.no_grad():
            output = self.network(nodes, edges, senders, receivers).numpy().astype(np.float64)
        mean, deviation = self.statistics["acceleration"]
        acceleration = (output * deviation + mean) @ turn_of(yaw).T
        following = acceleration + 2 * current - previous
        following[cloth.handles] = next_handles
        return following, acceleration


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model")
    parser.add_argument("rollout", help="a trajectory that `selvedge run` made with this model")
    parser.add_argument("--steps", type=int, default=100, help="frames to start from, evenly spread [default: 100]")
    args = parser.parse_args()
    model, cloth = Model(args.model), Cloth(*read(args.rollout))
    history, worst, largest, steps = model.history(), 0.0, 0.0, 0
    starts = np.unique(np.linspace(history - 1, len(cloth.frames) - 2, args.steps).astype(int))
    for number in starts:
        frames, truth = cloth.frames[number - history + 1 : number + 1], cloth.frames[number + 1]
        found, acceleration = model.step(cloth, frames, truth[cloth.handles])
        worst = max(worst, abs(found - truth).max())
        largest, steps = max(largest, abs(acceleration).max()), steps + 1
    print(f"spec: {json.dumps(model.spec)}")
    print(f"{steps} steps of {len(cloth.mass)} vertices: largest difference of a coordinate {worst:.2e} m,")
    print(f"largest acceleration {largest:.2e} m/frame²; f32 positions are exact to {np.abs(cloth.frames).max() * 2**-24:.1e} m")


if __name__ == "__main__":
    main()
