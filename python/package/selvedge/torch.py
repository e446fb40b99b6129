"""Data sets as PyTorch sees them. Needs torch."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import torch

from selvedge._native import Dataset


class Windows(torch.utils.data.Dataset):
    """The samples of a data set: frames in a row, and the next one.

    Item k is a dictionary of float32 tensors in metres: "positions" (history, n, 3), oldest first
    and the current frame last, and "target" (n, 3), the frame after it. "trajectory" and "frame"
    say where it is from. Where a trajectory has no earlier frame its first one is repeated, as if the
    cloth had stood still before.

    The last `kept` trajectories stay in memory.
    """

    def __init__(self, data: Dataset, history: int = 2, kept: int = 8) -> None:
        if history < 1:
            raise ValueError(f"history must be at least 1, found {history}")
        self.data = data
        self.history = history
        self.samples = data.samples
        self._read = functools.lru_cache(maxsize=kept)(data.train.__getitem__)

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
