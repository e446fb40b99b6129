"""Real drapes by other programs: each is fitted to measured drapes with the same few tries.

    python benches/peers/drapes.py drapes.csv --selvedge target/release/selvedge \\
        --peer mujoco_flex.py --substeps 2 --fabrics 1,2,3 --output out/drapes

A fabric is a sheet that is isotropic in its plane. Its bending stiffness is changed until the drape
coefficient is the mean of the captures of --specimens; that along one thread over that along the
other until the shadow is as oblong (second harmonic), where a program bends differently along the
two: of those here Selvedge alone. The other specimens are a check. The sheet that comes nearest is
draped on --drapes meshes. Meshes and measures are Selvedge's: a peer moves the mesh of the scene
`drape`, and `selvedge info` measures its last frame. Without --peer Selvedge itself is fitted, by the same search.
Rows are added to drapes.csv in --output. Needs NumPy, and the package of the peer.
"""

import argparse
import csv
import json
import math
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
RATE, FRAMES, ONSET = 60, 210, 0.7  # the last in s: cloth is laid down, not dropped
DENSITY, POISSON = 0.2, 0.3  # kg/m²; what hangs shows stiffness over mass alone
DAMPING = 5e-3  # s: comes to rest within the time
LIMP = 0.4  # coefficient below which a sheet gives way in its plane
STRETCH = {True: 100.0, False: 1000.0}  # stiffness in the plane [N/m] of a limp sheet, and of others
# Where a search begins: logarithm of bending stiffness over mass [m³/s²], over 1e-5, by coefficient.
BEND = {
    True: ([0.11, 0.13, 0.18, 0.3], [-1.9, -0.9, -0.2, 0.6]),
    False: ([0.45, 0.56, 0.6, 0.7, 0.78, 0.86, 0.93], [0.9, 1.65, 1.8, 2.25, 2.7, 3.2, 3.9]),
}
RISE = 0.11  # of the coefficient, where bending becomes e times as stiff
# Second harmonic [mm] of a sheet that bends alike along both threads, and how much more one has that is e times
# as stiff along one and e times as limp along the other.
ROUND, OBLONG = 1.0, 8.0
NEAR = 0.01, 1.0  # of the coefficient; of the second harmonic [mm]: near enough


def call(command: list) -> str:
    one = {name: "1" for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          env=os.environ | one)
    if done.returncode != 0:
        sys.exit((done.stderr or done.stdout).strip())
    return done.stdout


def scene_text(plate: float, ratio: float, stretch: float, seed: int, vertices: int) -> str:
    bend = ", ".join(str(5 * [4 * plate * along]) for along in (ratio, 1, 1 / ratio))
    rows = ", ".join(6 * [str([stretch / 2, 0.0, stretch / 2, stretch / 10])])
    return f"""name = "drape"
frame_rate = {RATE}
material = {{ name = "sheet", source = "peers", density = {DENSITY}, damping = {DAMPING}, stretch = [{rows}], bend = [{bend}] }}
mesh = {{ generator = {{ kind = "drape-disc", vertices = {vertices}, size = 0.3, seed = {seed} }}, transform = {{ rotation = {{ axis = [0, 0, 1], angle_deg = -90 }}, translation = [0.15, 0, 0] }} }}
handles = {{ label = "clamped" }}
environment = {{ onset = {ONSET} }}
physics = {{ even_bending = true }}
motion = {{ inline = {{ kind = "blocks", blocks = [{{ duration = {FRAMES / RATE} }}] }} }}
start = "mesh"
"""


def read(path: Path) -> tuple[dict, bytearray, int]:
    """Header, bytes and their start of a .safetensors file."""
    data = bytearray(path.read_bytes())
    size = struct.unpack("<Q", data[:8])[0]
    return json.loads(bytes(data[8:8 + size])), data, 8 + size


def array(header: dict, data: bytearray, start: int, name: str, kind: str) -> np.ndarray:
    begin, end = header[name]["data_offsets"]
    values = np.frombuffer(bytes(data[start + begin:start + end]), kind)
    return values.reshape(header[name]["shape"])


def drape(args: argparse.Namespace, plate: float, ratio: float, stretch: float, seed: int) -> list[float]:
    """Coefficient, nodes and amplitudes [mm] of a sheet of these stiffnesses [N m, N/m]; along v the first is
    ratio times as large, along u it is divided by it."""
    scene, run = args.output / "scene.toml", args.output / "run.safetensors"
    scene.write_text(scene_text(plate, ratio, stretch, seed, args.vertices))
    frames = [] if args.peer is None else ["--frames", "2"]
    call([args.selvedge, "run", scene, "-o", run, "--no-cache", "--quiet", *frames])
    if args.peer is not None:
        header, data, start = read(run)
        positions = array(header, data, start, "positions", "<f4")
        thickness = math.sqrt(12 * plate * (1 - POISSON**2) / stretch)
        values = {
            "name": "drape", "side": 0, "size": 0.3, "positions": positions[0].tolist(),
            "faces": array(header, data, start, "faces", "<u4").tolist(),
            "held": array(header, data, start, "handles", "<u4").tolist(), "ball": None,
            "frames": FRAMES, "rate": RATE, "density": DENSITY, "youngs_modulus": stretch / thickness,
            "poissons_ratio": POISSON, "thickness": thickness, "damping": DAMPING, "friction": 0.0,
            "gravity": 9.8, "onset": ONSET,
        }
        (args.output / "scene.json").write_text(json.dumps(values))
        moved = args.output / "peer.bin"
        call([args.python, HERE / args.peer, args.output / "scene.json", args.substeps, FRAMES, moved])
        last = np.fromfile(moved, "<f4").reshape(-1, positions.shape[1], 3)[-1]
        begin, end = header["positions"]["data_offsets"]
        data[start + begin:start + end] = np.broadcast_to(last, positions.shape).tobytes()
        run.write_bytes(data)
    found = json.loads(call([args.selvedge, "info", run, "--json"]))["drape"]
    return [found["coefficient"], found["nodes"], *(1e3 * a for a in found["harmonics"])]


def fit(args: argparse.Namespace, wanted: float, oblong: float) -> tuple[float, float, float, int, np.ndarray]:
    """Stiffness of bending, its ratio, that in the plane, number and drapes [seeds, measures] of the nearest try."""
    is_limp = wanted < LIMP
    plate, stretch = DENSITY * 1e-5 * math.exp(np.interp(wanted, *BEND[is_limp])), STRETCH[is_limp]
    beyond = math.sqrt(max(oblong**2 - ROUND**2, 0)) if args.peer is None else 0
    ratio = math.exp(beyond / OBLONG)
    best, nearest, tried = None, math.inf, []
    for number in range(1, args.tries + 1):
        made = np.array([drape(args, plate, ratio, stretch, seed) for seed in range(1, args.seeds + 1)])
        off, wide = wanted - made[:, 0].mean(), made[:, 2].mean()
        errors = abs(off) / NEAR[0], abs(oblong - wide) / NEAR[1] if beyond else 0
        if math.hypot(*errors) < nearest:
            best, nearest = (plate, ratio, stretch, number, made), math.hypot(*errors)
        if max(errors) < 1:
            break
        tried.append((math.log(plate), off))
        slope = RISE
        if len(tried) > 1 and abs(tried[-1][0] - tried[-2][0]) > 0.05:  # a secant, kept within reason
            slope = np.clip((tried[-2][1] - off) / (tried[-1][0] - tried[-2][0]), slope / 2, 2 * slope)
        if errors[0] >= 0.5:
            plate *= math.exp(np.clip(off / slope, -2.5, 2.5))
        if errors[1] >= 0.5:  # half of the way: where folds stand is chance
            ratio **= math.sqrt(min(beyond / math.sqrt(max(wide**2 - ROUND**2, 0.25)), 4))
    plate, ratio, stretch, number, made = best
    more = [drape(args, plate, ratio, stretch, seed) for seed in range(args.seeds + 1, args.drapes + 1)]
    return plate, ratio, stretch, number, np.array([*made, *more])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", type=Path)
    parser.add_argument("--selvedge", required=True, type=Path)
    parser.add_argument("--peer", help="mujoco_flex.py or blender_cloth.py")
    parser.add_argument("--python", default=sys.executable, help="a Python that has the peer")
    parser.add_argument("--substeps", type=int, default=4)
    parser.add_argument("--fabrics", default=",".join(str(k) for k in range(1, 26)))
    parser.add_argument("--specimens", default="1,5,9")
    parser.add_argument("--tries", type=int, default=4)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--drapes", type=int, default=0, help="of the sheet that was found, for its means")
    parser.add_argument("--vertices", type=int, default=1720)
    parser.add_argument("--output", required=True, type=Path)
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    keys = ["drape_coefficient", "nodes", *(f"a{k}_mm" for k in range(2, 9))]
    table = list(csv.DictReader(args.table.open()))
    errors = []
    for fabric in args.fabrics.split(","):
        mine = [row for row in table if row["fabric"] == fabric]
        fitted = [row for row in mine if row["sample"] in args.specimens.split(",")]
        others = [row for row in mine if row not in fitted]
        real, check = (np.array([[float(row[key]) for key in keys] for row in rows])
                       for rows in (fitted, others))
        plate, ratio, stretch, tries, made = fit(args, real[:, 0].mean(), real[:, 2].mean())
        row = [fabric, f"{plate / DENSITY:.3g}", f"{stretch:.0f}", tries]
        for measured in (made, real, check):
            means = measured.mean(axis=0) if len(measured) else np.full(len(keys), np.nan)
            spread = measured[:, 0].std() if len(measured) else np.nan
            row += [f"{means[0]:.4f}", f"{spread:.4f}", *(f"{mean:.2f}" for mean in means[1:])]
        row.append(f"{ratio:.3f}")
        with (args.output / "drapes.csv").open("a") as file:
            csv.writer(file).writerow(row)
        errors.append(np.abs(made.mean(axis=0) - real.mean(axis=0))[:2])
        print(f"{fabric}: {tries} tries, coefficient {row[4]} for {row[14]}, nodes {row[6]} for {row[16]}, "
              f"second harmonic {row[7]} for {row[17]} mm with a ratio of {row[-1]}",
              flush=True)
    print("mean error: coefficient {:.3f}, nodes {:.1f}".format(*np.mean(errors, axis=0)))


if __name__ == "__main__":
    main()
