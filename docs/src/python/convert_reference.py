"""Unpacks ARCSim reference runs (.npz) into the plain .npy files that squeeze.py beside this file reads.

    python3 convert_reference.py FOLDER_WITH_NPZ OUTPUT_FOLDER

Floats become f64, integers i64, little endian, C order; texts are left out. Of squeeze_coll the
handles' targets are also written for every substep, on ARCSim's curve through its keyframes.
"""

import json
import pathlib
import sys

import numpy as np

source, output = map(pathlib.Path, sys.argv[1:3])
for name in ["onestep", "rest_states", "fwd_seed", "squeeze_coll"]:
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    with np.load(source / f"{name}.npz") as fields:
        for key, value in fields.items():
            if value.dtype.kind == "f":
                np.save(folder / f"{key}.npy", np.ascontiguousarray(value, "<f8"))
            elif value.dtype.kind in "iu":
                np.save(folder / f"{key}.npy", np.ascontiguousarray(value, "<i8"))


def targets(fields):
    """The handles at the end of every substep, [substeps + 1, handles, 3]: cubic between keyframes,
    with the slope from the one before to the one after, none at the first and the last."""
    motions = json.loads(str(fields["scene_json"]))["motions"]
    dt = float(fields["frame_dt"]) / int(fields["substeps"])
    ends = np.arange(int(fields["substeps"]) * (len(fields["positions"]) - 1) + 1) * dt
    start = fields["rest_positions"][fields["handles"]]
    paths = []
    for keys, place in zip(motions, start):
        t = np.array([key["time"] for key in keys])
        x = np.array([key["transform"]["translate"] for key in keys])
        v = np.zeros_like(x)
        v[1:-1] = (x[2:] - x[:-2]) / (t[2:] - t[:-2])[:, None]
        k = np.clip(np.searchsorted(t, ends, side="right"), 1, len(t) - 1)
        span = t[k] - t[k - 1]
        s = np.clip((ends - t[k - 1]) / span, 0, 1)[:, None]
        span = span[:, None]
        path = x[k - 1] * (2 * s**3 - 3 * s**2 + 1) + x[k] * (3 * s**2 - 2 * s**3)
        path += (v[k - 1] * (s**3 - 2 * s**2 + s) + v[k] * (s**3 - s**2)) * span
        paths.append(place + path)
    return np.stack(paths, axis=1)


with np.load(source / "squeeze_coll.npz") as fields:
    np.save(output / "squeeze_coll" / "substep_targets.npy", targets(fields))
