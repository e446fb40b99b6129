"""Cloth simulators side by side: ms per frame, and the error at which they are reached.

Each method moves the same two sheets of 1024 vertices, with several numbers of substeps, and once
with many: its own converged motion. Errors are distances to that, so that no method is measured by
another's physics. Times are processor times, without start-up; what uses two threads pays for both.

    python3.13 benches/peers/peers.py --selvedge target/release/selvedge --output out/peers

README.md says what is installed and where. Needs NumPy.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SIDE = 32  # vertices
RATE = 60  # frames per second
MATERIAL = {
    "density": 0.187,
    "youngs_modulus": 1e6,
    "poissons_ratio": 0.3,
    "thickness": 5e-4,
    "damping": 1e-3,
    "friction": 0.3,
    "gravity": 9.8,
}
LIMIT = 900  # s of wall time for a run
TIMES = (0.25, 0.5, 1.0)  # s, at which errors are measured


@dataclass(frozen=True)
class Method:
    """A way to move the sheet: how it is started, and its numbers of substeps per frame.

    `finest` is the number of its converged motion. `packages` are what pip installs. `program` is
    `selvedge`, a file of this folder, or `rapier`, and the words that choose the method.
    """

    name: str
    program: str
    substeps: tuple[int, ...]
    finest: int
    packages: tuple[str, ...] = ()


METHODS = (
    Method("Selvedge", "selvedge", (1, 2, 4), 64),
    Method("MuJoCo flex", "mujoco_flex.py", (1, 2, 4), 32, ("mujoco",)),
    Method("Newton VBD", "newton_cloth.py vbd", (2, 4, 8), 64, ("newton",)),
    Method("Newton Style3D", "newton_cloth.py style3d", (1, 2, 4), 32, ("newton",)),
    Method("Blender", "blender_cloth.py", (2, 5, 10), 80, ("bpy",)),  # Blender has no more than 80
    Method("Rapier constraints", "rapier constraints", (4, 8, 16), 128),
    Method("Rapier FEM", "rapier fem", (1, 2, 4), 32),
    Method("rapier-cloth-core XPBD", "rapier xpbd", (4, 8, 16), 128),
    Method("rapier-cloth-core implicit", "rapier implicit", (1, 2, 4), 32),
)


def sheet(size: float, corner: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Positions [1024, 3] in m and faces of a square in the plane of x and z, diagonals alternating."""
    step = size / (SIDE - 1)
    grid = [(i * step, 0.0, j * step) for j in range(SIDE) for i in range(SIDE)]
    faces = []
    for j in range(SIDE - 1):
        for i in range(SIDE - 1):
            a = j * SIDE + i
            b, c, d = a + 1, a + SIDE + 1, a + SIDE
            faces += [(a, c, b), (a, d, c)] if (i + j) % 2 == 0 else [(a, d, b), (b, d, c)]
    return np.array(grid) + np.array(corner), np.array(faces)


def scenes() -> list[dict]:
    """The two scenes, as common.Scene has them."""
    made = []
    for name, size, corner, held, ball, seconds in (
        ("sheet", 1.0, (-0.5, 1.0, 0.0), [0, SIDE - 1], None, 2.0),
        ("drape", 0.8, (-0.4, 0.35, -0.4), [], 0.2, 1.5),
    ):
        positions, faces = sheet(size, corner)
        made.append({
            "name": name, "side": SIDE, "size": size, "positions": positions.tolist(),
            "faces": faces.tolist(), "held": held, "ball": ball, "frames": round(seconds * RATE),
            "rate": RATE, **MATERIAL,
        })
    return made


class Skipped(Exception):
    """Why a method did not run."""


@dataclass(frozen=True)
class Place:
    """Where things are: the folder of the results, the programs."""

    output: Path
    selvedge: Path | None

    @property
    def python(self) -> Path:
        """Python of the virtual environment."""
        return self.output / "venv" / "bin" / "python"

    @property
    def rapier(self) -> Path:
        """The program of the peers in Rust."""
        return self.output / "rapier" / "release" / "rapier-peers"


def call(command: list, limit: int | None = None) -> str:
    """Runs a program to its end and gives what it printed. The error is the last line of what it said."""
    one_thread = {name: "1" for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    try:
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                              timeout=limit, env=os.environ | one_thread)
    except subprocess.TimeoutExpired:
        raise Skipped(f"a run took more than {limit} s")
    if done.returncode != 0:
        said = (done.stderr.strip() or done.stdout.strip() or f"exit {done.returncode}").splitlines()
        raise Skipped(said[-1])
    return done.stdout


def install(place: Place, method: Method) -> None:
    """Installs or builds what a method needs, where that is not there yet."""
    if method.program == "selvedge":
        if place.selvedge is None:
            raise Skipped("no --selvedge was given")
    elif method.program.startswith("rapier"):
        call(["cargo", "build", "--release", "--locked", "--manifest-path", HERE / "rapier" / "Cargo.toml",
              "--target-dir", place.output / "rapier"])
    else:
        if not place.python.exists():
            call([sys.executable, "-m", "venv", place.output / "venv"])
        call([place.python, "-m", "pip", "install", "--quiet", "--constraint", HERE / "requirements.txt",
              "numpy", *method.packages])


def selvedge_scene(scene: dict, substeps: int, folder: Path) -> Path:
    """Writes the scene for Selvedge, beside its mesh, and gives its path."""
    lines = ["v {} {} {}".format(*point) for point in scene["positions"]]
    lines += ["f {} {} {}".format(*(k + 1 for k in face)) for face in scene["faces"]]
    (folder / f"{scene['name']}.obj").write_text("\n".join(lines) + "\n")
    elastic = {key: scene[key] for key in ("youngs_modulus", "poissons_ratio", "thickness")}
    values = {
        "name": scene["name"],
        "frame_rate": scene["rate"],
        "mesh": {"file": f"{scene['name']}.obj"},
        "start": "mesh",
        "material": {"name": "sheet", "density": scene["density"], "damping": scene["damping"],
                     "isotropic": elastic},
        "environment": {"gravity": [0, -scene["gravity"], 0], "air_density": 0.0},
        "physics": {"substeps": substeps},
    }
    if scene["held"]:
        values["handles"] = {"vertices": scene["held"]}
    if scene["ball"]:
        values["contact"] = {"friction": scene["friction"], "self": False}
        values["obstacles"] = [{"name": "ball", "sphere": {"radius": scene["ball"]}}]
    path = folder / f"{scene['name']}.toml"
    path.write_text("".join(f"{key} = {toml(value)}\n" for key, value in values.items()))
    return path


def toml(value) -> str:
    """A value of numbers, text, lists and tables as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def selvedge(place: Place, scene: dict, substeps: int, frames: int) -> tuple[np.ndarray, float]:
    """A run of the command line; its time is that of all frames less that of a run of one frame."""
    folder = place.output / "selvedge"
    folder.mkdir(exist_ok=True)
    path = selvedge_scene(scene, substeps, folder)
    seconds = []
    for length in (1, frames):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        call([place.selvedge, "-q", "run", path, "--frames", length, "-o", folder / "run.safetensors",
              "--export", folder / "run.npz"], LIMIT)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    with np.load(folder / "run.npz") as arrays:
        return arrays["positions"], (seconds[1] - seconds[0]) * frames / (frames - 1)


def run(place: Place, method: Method, scene: dict, substeps: int, frames: int) -> tuple[np.ndarray, float]:
    """Positions [frames + 1, vertices, 3] in m and processor time of the frames in s."""
    if method.program == "selvedge":
        return selvedge(place, scene, substeps, frames)
    output = place.output / "positions.bin"
    program = method.program.split()
    start = [place.rapier, *program[1:]] if program[0] == "rapier" else [place.python, HERE / program[0], *program[1:]]
    said = call([*start, place.output / f"{scene['name']}.json", substeps, frames, output], LIMIT)
    positions = np.fromfile(output, dtype="<f4").reshape(frames + 1, -1, 3)
    return positions, float(said.split()[-1])


def strain(positions: np.ndarray, scene: dict) -> float:
    """Largest l/l₀ - 1 of an edge in any of the frames."""
    faces = np.array(scene["faces"])
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    lengths = np.linalg.norm(positions[:, pairs[:, 0]] - positions[:, pairs[:, 1]], axis=-1)
    return float((lengths / lengths[0]).max() - 1)


def errors(positions: np.ndarray, converged: np.ndarray) -> list[float]:
    """Root mean squares over the vertices of the distances at TIMES, in mm."""
    found = []
    for second in TIMES:
        frame = round(second * RATE)
        if frame < len(positions):
            away = np.linalg.norm(positions[frame] - converged[frame], axis=-1)
            found.append(1000 * float(np.sqrt((away**2).mean())))
    return found


def measure(place: Place, method: Method, scene: dict, options: argparse.Namespace) -> list[dict]:
    """A row for every number of substeps of a method."""
    frames = 10 if options.quick else scene["frames"]
    last = min(frames, round(max(TIMES) * RATE))
    converged, _ = run(place, method, scene, method.finest, last)
    half, _ = run(place, method, scene, method.finest // 2, last)
    rows = []
    for substeps in method.substeps:
        row = {"scene": scene["name"], "method": method.name, "substeps": substeps, "finest": method.finest}
        try:
            runs = [run(place, method, scene, substeps, frames) for _ in range(options.runs)]
            positions = runs[0][0]
            row["ms"] = 1000 * min(seconds for _, seconds in runs) / frames
            row |= dict(zip((f"error_{second}" for second in TIMES), errors(positions, converged)))
            row |= dict(zip((f"floor_{second}" for second in TIMES), errors(half, converged)))
            row["strain"] = strain(positions[: last + 1], scene)
            row["strain_converged"] = strain(converged, scene)
        except Skipped as reason:
            row["note"] = str(reason)
        rows.append(row)
    return rows


def table(rows: list[dict]) -> str:
    """The rows as Markdown: each number of substeps in all scenes, then half of the converged number."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    times = ", ".join(f"{second:g}" for second in TIMES)
    text = ["| method | substeps |" + "".join(f" {name}: ms per frame | RMSE at {times} s, mm | strain |" for name in scenes),
            "|---|---:|" + "---:|---:|---:|" * len(scenes)]

    def distances(row: dict, kind: str) -> str:
        return ", ".join(f"{row[key]:.1f}" for key in (f"{kind}_{second}" for second in TIMES) if key in row)

    def cells(row: dict | None) -> str:
        if row is None or "note" in row:
            return f" {row['note'] if row else ''} | | |"
        return f" {row['ms']:.2f} | {distances(row, 'error')} | {100 * row['strain']:.0f} % |"

    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        for substeps in dict.fromkeys(row.get("substeps") for row in own):
            of = {row["scene"]: row for row in own if row.get("substeps") == substeps}
            label = "" if substeps is None else f"{substeps:.0f}"
            text.append(f"| {method} | {label} |" + "".join(cells(of.get(name)) for name in scenes))
        done = {row["scene"]: row for row in own if "ms" in row}
        if done:
            finest = next(iter(done.values()))["finest"]
            floors = (f" | {distances(done[name], 'floor')} | {100 * done[name]['strain_converged']:.0f} % |"
                      if name in done else " | | |" for name in scenes)
            text.append(f"| | *{finest // 2:.0f} of {finest:.0f}* |" + "".join(floors))
    return "\n".join(text) + "\n"


def kept(place: Place) -> list[dict]:
    """The rows of an earlier run, with numbers where there are some."""
    path = place.output / "peers.csv"
    if not path.exists():
        return []
    words, names = ("scene", "method", "note"), {method.name for method in METHODS}
    with open(path, newline="") as file:
        return [{key: value if key in words else float(value) for key, value in row.items() if value}
                for row in csv.DictReader(file) if row["method"] in names]


def write(place: Place, rows: list[dict]) -> None:
    """Writes the rows as peers.csv and peers.md, by scene and in the order of METHODS."""
    order = [method.name for method in METHODS]
    rows.sort(key=lambda row: (row["scene"] != "sheet", order.index(row["method"])))
    names = list(dict.fromkeys(key for row in rows for key in row))
    with open(place.output / "peers.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    (place.output / "peers.md").write_text(table(rows))


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--selvedge", type=Path, help="the program selvedge; without, it is left out")
    parser.add_argument("--output", type=Path, default=Path("out/peers"),
                        help="folder of the results, the virtual environment and the build [out/peers]")
    parser.add_argument("--runs", type=int, default=3, help="runs of each, of which the least time counts [3]")
    parser.add_argument("--only", nargs="*", choices=[method.name for method in METHODS], help="these methods alone")
    parser.add_argument("--scene", choices=["sheet", "drape"], help="this scene alone")
    parser.add_argument("--quick", action="store_true", help="10 frames of each")
    return parser.parse_args()


def main() -> None:
    options = parse()
    place = Place(options.output.resolve(), options.selvedge and options.selvedge.resolve())
    place.output.mkdir(parents=True, exist_ok=True)
    chosen = [scene for scene in scenes() if options.scene in (None, scene["name"])]
    for scene in chosen:
        (place.output / f"{scene['name']}.json").write_text(json.dumps(scene))
    rows = kept(place)
    for method in METHODS:
        if options.only and method.name not in options.only:
            continue
        for scene in chosen:
            print(f"{method.name}, {scene['name']} ...", flush=True)
            rows = [row for row in rows if (row["method"], row["scene"]) != (method.name, scene["name"])]
            try:
                install(place, method)
                rows += measure(place, method, scene, options)
            except Skipped as reason:
                print(f"  skipped: {reason}", flush=True)
                rows.append({"scene": scene["name"], "method": method.name, "note": f"skipped: {reason}"})
            write(place, rows)
    print(table(rows))


if __name__ == "__main__":
    main()
