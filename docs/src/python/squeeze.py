"""Runs ARCSim's squeezed sheet from its state at 1 s with ARCSim's law of contact, and sets ARCSim's own recording beside it.

    python convert_reference.py FOLDER_WITH_NPZ REFERENCE
    python squeeze.py REFERENCE OUT

Needs numpy and safetensors from PyPI, and the program `selvedge` in the PATH (or named by SELVEDGE). Writes to OUT both
trajectories, with a frame for each of ARCSim's four substeps, and a clip of each; prints how far the vertices are apart in
frames of ARCSim.
"""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
from safetensors import safe_open
from safetensors.numpy import save_file

FIRST, LAST, SUBSTEPS = 60, 180, 4
reference, out = map(pathlib.Path, sys.argv[1:3])
program = os.environ.get("SELVEDGE", "selvedge")
out.mkdir(parents=True, exist_ok=True)
uv, faces, handles, truth, x, v, targets = (
    np.load(reference / "squeeze_coll" / f"{name}.npy")
    for name in ["uv", "faces", "handles", "positions", "ckpt_x", "ckpt_v", "substep_targets"]
)

mesh = [f"v 0 {b - 1:.17g} {a - 0.5:.17g}" for a, b in uv] + [f"vt {a:.17g} {b:.17g}" for a, b in uv]
mesh += ["f " + " ".join(f"{k + 1}/{k + 1}" for k in face) for face in faces]
(out / "sheet.obj").write_text("\n".join(mesh) + "\n")
rows = [f"{n},{h},{p[0]:.17g},{p[1]:.17g},{p[2]:.17g}" for n, row in enumerate(targets) for h, p in enumerate(row)]
(out / "targets.csv").write_text("\n".join(["frame,handle,x,y,z"] + rows) + "\n")
np.savez(out / "state.npz", positions=x[1], velocities=v[1])
(out / "squeeze.toml").write_text(f"""
name = "Selvedge"
frame_rate = {60 * SUBSTEPS}
material = "gray-interlock"
mesh = {{ file = "sheet.obj" }}
handles = {{ vertices = {handles.tolist()} }}
motion = {{ recorded = "targets.csv" }}
physics = {{ mode = "arcsim", substeps = 1 }}
contact = {{ law = "arcsim" }}
start = {{ state = {{ file = "state.npz", frame = {FIRST * SUBSTEPS} }} }}
""")


def run(*words):
    subprocess.run([program, *map(str, words)], check=True)


run("run", out / "squeeze.toml", "--frames", (LAST - FIRST) * SUBSTEPS, "-o", out / "selvedge.safetensors")
with safe_open(out / "selvedge.safetensors", "np") as file:
    arrays, metadata = {name: file.get_tensor(name) for name in file.keys()}, file.metadata()
ours, theirs = arrays["positions"][::SUBSTEPS], truth[FIRST : LAST + 1].astype(np.float32)
# Between its frames, which are every fourth of ours, ARCSim's recording says nothing.
arrays["positions"] = np.repeat(theirs, SUBSTEPS, axis=0)[: len(arrays["positions"])]
scene = json.loads(metadata["scene"]) | {"name": "ARCSim"}
save_file(arrays, out / "arcsim.safetensors", metadata | {"scene": json.dumps(scene)})
apart = np.linalg.norm(ours - theirs, axis=2) * 1e3
for frame in [FIRST + 1, 77, 78, 81, 82, 83, 85, 90, 96, 100, 110, 124, 140, 160, LAST]:
    distances = apart[frame - FIRST]
    print(f"frame {frame}: largest {distances.max():.3g} mm, mean {distances.mean():.3g} mm")
for name in ["selvedge", "arcsim"]:
    # From the first contact on, ten pictures a second.
    frames = ["--frames", f"{(78 - FIRST) * SUBSTEPS}..", "--every", 24]
    run("export", out / f"{name}.safetensors", "-o", out / f"squeeze-{name}.gif", *frames)
