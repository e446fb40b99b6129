"""Unpacks ARCSim reference runs (.npz) into the plain .npy files that reference.rs beside this file reads.

    python3 convert_reference.py FOLDER_WITH_NPZ OUTPUT_FOLDER
    SELVEDGE_ARCSIM_REFERENCE=OUTPUT_FOLDER cargo test --release -p selvedge-sim --test physics reference

Floats become f64, integers i64, little endian, C order; texts are left out.
"""

import pathlib
import sys

import numpy as np

source, output = map(pathlib.Path, sys.argv[1:3])
for name in ["onestep", "rest_states", "fwd_seed"]:
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    with np.load(source / f"{name}.npz") as fields:
        for key, value in fields.items():
            if value.dtype.kind == "f":
                np.save(folder / f"{key}.npy", np.ascontiguousarray(value, "<f8"))
            elif value.dtype.kind in "iu":
                np.save(folder / f"{key}.npy", np.ascontiguousarray(value, "<i8"))
