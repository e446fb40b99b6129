"""Measures a model of your own on the test split of a data set: python compare_model.py FOLDER

Put your model in the place of `step`. `selvedge eval` measures the shipped networks, the solver and the baselines
on the same trajectories.
"""

import sys

import numpy as np
import selvedge


def step(frames, goal, cloth):
    """The next frame (vertices, 3) from the frames so far and the next places of the handles. This one only
    moves the newest frame along with the handles."""
    moved = frames[-1] + (goal - frames[-1][cloth.handles]).mean(0)
    moved[cloth.handles] = goal
    return moved


def errors(truth, step, horizons=(1, 10, 50), starts=3):
    """Root mean square distances [m] to the truth: at frames after true states, and over the whole run."""

    def run(start, frames):
        positions = list(truth.positions[: start + 1])
        for goal in truth.positions[start + 1 : start + 1 + frames, truth.handles]:
            positions.append(step(positions, goal, truth))
        return np.stack(positions)

    def distance(a, b):
        return float(np.sqrt(((a - b).astype(float) ** 2).sum(-1).mean()))

    last = len(truth) - 1 - max(horizons)
    found = {k: [] for k in horizons}
    for start in np.linspace(1, last, starts).astype(int):
        ahead = run(start, max(horizons))
        for k in horizons:
            found[k].append(distance(ahead[start + k], truth.positions[start + k]))
    found["whole"] = [distance(run(1, len(truth) - 2), truth.positions)]
    return {name: float(np.mean(values)) for name, values in found.items()}


if __name__ == "__main__":
    tests = [errors(truth, step) for truth in selvedge.Dataset(sys.argv[1]).test]
    for name in tests[0]:
        label = "whole runs" if name == "whole" else f"after {name} frames"
        print(f"{label}: {1000 * np.mean([test[name] for test in tests]):.3g} mm")
