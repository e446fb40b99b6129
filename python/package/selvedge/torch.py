"""Data sets as PyTorch sees them. Needs torch."""

from __future__ import annotations

import functools
from typing import Any, Literal

import numpy as np
import torch

from selvedge._native import Dataset


class Windows(torch.utils.data.Dataset):
    """The samples of a data set: frames in a row, and the next one; of the trajectories to train on,
    or all frames of those to test on.

    Item k is a dictionary of float32 tensors in metres: "positions" (history, n, 3), oldest first
    and the current frame last, and "target" (n, 3), the frame after it. "trajectory" and "frame"
    say where it is from. Where a trajectory has no earlier frame its first one is repeated, as if the
    cloth had stood still before.

    `cloth(trajectory)` is what a graph network needs beside: edges, the shape at rest, handles and
    masses. The last `kept` trajectories stay in memory of each process: workers of a `DataLoader` may
    be forked or spawned.
    """

    def __init__(
        self,
        data: Dataset,
        history: int = 2,
        kept: int = 8,
        split: Literal["train", "test"] = "train",
    ) -> None:
        if history < 1:
            raise ValueError(f"history must be at least 1, found {history}")
        if split not in ("train", "test"):
            raise ValueError(f"split must be train or test, found {split!r}")
        self.data = data
        self.history = history
        self.split = split
        self.samples = data.samples if split == "train" else self._all_frames(data.index["splits"][split])
        self._kept = kept
        self._keep()

    @staticmethod
    def _all_frames(entries: list[dict[str, Any]]) -> np.ndarray:
        pairs = [(k, frame) for k, entry in enumerate(entries) for frame in range(1, entry["frames"] - 1)]
        return np.array(pairs, np.uint32).reshape(-1, 2)

    def _keep(self) -> None:
        read = getattr(self.data, self.split).__getitem__
        self._read = functools.lru_cache(maxsize=self._kept)(read)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_read"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._keep()

    def cloth(self, trajectory: int) -> dict[str, torch.Tensor]:
        """The cloth of a trajectory: "edges" (e, 2) and "faces" (f, 3), int64, "rest" (n, 3) [m],
        "masses" (n,) [kg], and "held" (n,), bool, which is true for handles."""
        run = self._read(trajectory)
        held = np.zeros(len(run.masses), bool)
        held[run.handles] = True
        whole = {"edges": run.edges.astype(np.int64), "faces": run.faces.astype(np.int64), "held": held}
        real = {"rest": run.rest_positions.copy(), "masses": run.masses.copy()}
        return {name: torch.from_numpy(values) for name, values in (whole | real).items()}

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, number: int) -> dict[str, Any]:
        trajectory, frame = (int(x) for x in self.samples[number])
        positions = self._read(trajectory).positions
        window = np.maximum(np.arange(frame - self.history + 1, frame + 1), 0)
        return {
            # A copy: tensors over memory that must not be written would be unsafe.
            "positions": torch.from_numpy(positions[window]),
            "target": torch.from_numpy(positions[frame + 1].copy()),
            "trajectory": trajectory,
            "frame": frame,
        }
