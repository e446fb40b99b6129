"""What a file or a folder is, and what is in it."""

from __future__ import annotations

import json
import pathlib
import struct
from typing import Any

from selvedge._native import Dataset, Model, Scene, SelvedgeError, Trajectory

MOST_HEADER = 100_000_000


def inspect(path: str | pathlib.Path) -> dict[str, Any]:
    """Says what `path` is: a trajectory, a model, a data set or a scene, with its main numbers.

    Other files are known to `selvedge info` on the command line.
    """
    path = pathlib.Path(path)
    if path.is_dir():
        data = Dataset(path)
        index = data.index
        return {
            "kind": "data set",
            "name": data.name,
            "train": data.train.motions,
            "test": data.test.motions,
            "statistics": index["statistics"],
        }
    if path.suffix in (".toml", ".json"):
        scene = Scene(str(path))
        return {
            "kind": "scene",
            "name": scene.name,
            "vertices": len(scene.positions),
            "handles": scene.handles.tolist(),
            "frames": scene.frames,
            "frame_rate": scene.frame_rate,
            "material": scene.material.name,
            "warnings": scene.warnings,
        }
    kind = _format_of(path)
    if kind == "selvedge-model":
        model = Model(path)
        return {
            "kind": "model",
            "parameters": model.parameters,
            "spec": model.spec,
            "training": model.training,
        }
    trajectory = Trajectory.read(path)
    return {
        "kind": "trajectory",
        "frames": len(trajectory),
        "vertices": trajectory.positions.shape[1],
        "handles": trajectory.handles.tolist(),
        "frame_rate": trajectory.frame_rate,
        "scene": (trajectory.scene or {}).get("name"),
    }


def _format_of(path: pathlib.Path) -> str | None:
    """The format that the header of a safetensors file names."""
    try:
        with path.open("rb") as file:
            size = file.read(8)
            length = struct.unpack("<Q", size)[0] if len(size) == 8 else 0
            if not 0 < length <= MOST_HEADER:
                return None
            header = json.loads(file.read(length))
    except OSError as error:
        raise SelvedgeError(f"{path}: could not be read: {error}") from error
    except (ValueError, UnicodeDecodeError):
        return None
    return header.get("__metadata__", {}).get("format")
