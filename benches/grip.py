"""How a grip holds: the table of substeps, meshes and fabrics.

    pip install ./python && python benches/grip.py --seconds 10 --output grip.csv

Two boxes of 30 mm close on the upper edge of a towel of 30 cm to 0.3 mm a side, with friction 0.6. Of each row:

- held: its corners let go, the towel is lifted by 30 cm, hangs for `--seconds` and is shaken up and down at 2 m/s²
  as long; how far vertices between the fingers slid by the end of each [mm].
- pull: its upper edge stays held and the fingers are drawn down by 4 cm; their drag over 2 mu N, N what they press with,
  over the frames in which every vertex between them slides. Cloth that slides off stretches, and what comes between the
  fingers sticks until it is stretched as well: until then less than all of it slides.
- weak: the towel hangs, and the fingers open slowly; 2 mu N over its weight when all between them slips, by 2 cm/s.

A row that fails says why. No frame has an intersection: the solver fails sooner.
"""

import argparse
import csv
import itertools
import sys
import time

import numpy as np
import selvedge

SIDE, PAD, FRICTION, DEPTH = 0.3, 0.03, 0.6, 0.02
SHAKEN, FREQUENCY = 2.0, 3.0
# How far the fingers are drawn [m], in how many frames, and the part of their way that counts as sliding.
PULL, PULL_FRAMES, ALL_SLIDE = 0.04, 48, 0.9
# How far the fingers open in a frame [m], for how many frames, and the speed that counts as slipping [m/s].
OPEN, OPEN_FRAMES, SLIPS = 2e-7, 3600, 0.02

SCENE = """
name = "grip"
material = "{fabric}"
mesh = {{ generator = {{ kind = "square", vertices = {vertices}, size = {side}, seed = 1 }} }}
handles = {{ label = "upper-corners" }}
start = "mesh"
physics = {{ substeps = {substeps} }}
contact = {{ thickness = 0.001, friction = {friction} }}
obstacles = [
    {{ name = "left", box = {{ size = [0.02, {pad}, {pad}] }}, transform = {{ translation = [-0.03, -{depth}, 0] }} }},
    {{ name = "right", box = {{ size = [0.02, {pad}, {pad}] }}, transform = {{ translation = [0.03, -{depth}, 0] }} }},
]
"""


def smooth(part):
    part = np.clip(part, 0.0, 1.0)
    return 3 * part**2 - 2 * part**3


class Grip:
    """The towel with its fingers closed."""

    def __init__(self, fabric, spacing, substeps, by_edge=False):
        vertices = round((SIDE / spacing + 1) ** 2)
        text = SCENE.format(
            fabric=fabric, vertices=vertices, side=SIDE, substeps=substeps, friction=FRICTION, pad=PAD, depth=DEPTH
        )
        scene = selvedge.Scene.parse(text)
        if by_edge:
            mesh = selvedge.Mesh.generate("square", vertices, SIDE, 1)
            edge = np.flatnonzero(mesh.positions[:, 1] > mesh.positions[:, 1].max() - 1e-6)
            scene = scene.with_mesh(mesh, edge.tolist())
        self.cloth = selvedge.Simulator(scene)
        self.held = self.cloth.positions[self.cloth.handles].copy()
        for frame in range(1, 31):
            self.step(0.0, True, 0.0197 * smooth(frame / 24))
        places = self.cloth.positions
        inner = np.abs(places - [0.0, -DEPTH, 0.0])[:, 1:].max(axis=1) < 0.4 * PAD
        self.between, self.start = inner, places[inner].copy()

    def step(self, up, holds, closed=0.0197):
        for body, sign in enumerate((1, -1)):
            matrix = np.eye(4)
            matrix[:3, 3] = [sign * closed, up, 0.0]
            self.cloth.lead_body(body, matrix)
        self.cloth.step(self.held, [not holds] * len(self.held))

    def slip(self, up):
        """The farthest that a vertex between the fingers slid [mm]."""
        ways = self.cloth.positions[self.between] - self.start - [0.0, up, 0.0]
        return 1e3 * float(np.linalg.norm(ways, axis=1).max(initial=0.0))


def held(fabric, spacing, substeps, seconds):
    """Slip at rest and shaken [mm]."""
    grip, frames = Grip(fabric, spacing, substeps), round(60 * seconds)
    for frame in range(1, 121):
        grip.step(SIDE * smooth(frame / 120), False)
    for _ in range(frames):
        grip.step(SIDE, False)
    at_rest, rate = grip.slip(SIDE), 2 * np.pi * FREQUENCY
    for frame in range(1, frames + 1):
        grip.step(up := SIDE + SHAKEN / rate**2 * np.sin(rate * frame / 60), False)
    return int(grip.between.sum()), at_rest, grip.slip(up)


def pulled(fabric, spacing, substeps):
    """Drag of the fingers while the cloth slides off them, over 2 mu N, N, and of how many frames that is."""
    grip, drags, pushes = Grip(fabric, spacing, substeps, True), [], []
    for frame in range(1, PULL_FRAMES + 1):
        before, down = grip.cloth.positions[:, 1].copy(), PULL * frame / PULL_FRAMES
        grip.step(-down, True)
        places = grip.cloth.positions
        between = np.abs(places - [0.0, -DEPTH - down, 0.0])[:, 1:].max(axis=1) < 0.5 * PAD
        slid = 1 + (places[:, 1] - before)[between] * PULL_FRAMES / PULL
        if slid.min(initial=np.inf) > ALL_SLIDE and between.any():
            received = grip.cloth.impulses[:, 0] * 60
            drags.append(np.abs(received[:, 1]).sum())
            pushes.append(np.abs(received[:, 0]).mean())
    if not drags:
        raise ValueError("never all of it slides")
    return np.mean(drags) / (2 * FRICTION * np.mean(pushes)), np.mean(pushes), len(drags)


def weak(fabric, spacing, substeps):
    """2 mu N over the weight of the towel when all between fingers that open slips, N averaged over six frames."""
    grip = Grip(fabric, spacing, substeps)
    closed = 0.0197
    for _ in range(60):
        grip.step(0.0, False)
    weight, pushes = 9.81 * selvedge.Material(fabric).density * SIDE**2, []
    for _ in range(OPEN_FRAMES):
        before = grip.cloth.positions[:, 1].copy()
        # Ten times as fast while it holds three times the weight.
        strong = 2 * FRICTION * np.mean(pushes[-6:] or [np.inf]) > 3 * weight
        closed -= OPEN * (10 if strong else 1)
        grip.step(0.0, False, closed)
        pushes.append(np.abs(grip.cloth.impulses[:, 0, 0]).mean() * 60)
        places = grip.cloth.positions
        between = np.abs(places - [0.0, -DEPTH, 0.0])[:, 1:].max(axis=1) < 0.5 * PAD
        if (before - places[:, 1])[between].min(initial=np.inf) * 60 > SLIPS:
            return 2 * FRICTION * np.mean(pushes[-6:]) / weight
    raise ValueError("never slips")


def main():
    fabrics = ["gray-interlock", "navy-sparkle-sweat", "camel-ponte-roma", "11oz-black-denim"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--substeps", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--spacing", type=float, nargs="+", default=[0.020, 0.015, 0.010, 0.007])
    parser.add_argument("--fabrics", nargs="+", default=fabrics)
    parser.add_argument("--seconds", type=float, default=10.0, help="0: only pulled and weak")
    parser.add_argument("--output", default=None)
    chosen = parser.parse_args()
    output = open(chosen.output, "w", newline="") if chosen.output else sys.stdout
    rows = csv.writer(output)
    rows.writerow("fabric,mesh mm,substeps,vertices between,slip at rest mm,slip shaken mm,pull over 2 mu N,frames,N,weak over weight,took s".split(","))
    for spacing, fabric, substeps in itertools.product(chosen.spacing, chosen.fabrics, chosen.substeps):
        began, row = time.perf_counter(), [fabric, f"{spacing * 1e3:g}", substeps]
        try:
            if chosen.seconds > 0:
                count, at_rest, shaken = held(fabric, spacing, substeps, chosen.seconds)
                row += [count, f"{at_rest:.3f}", f"{shaken:.3f}"]
            else:
                row += ["", "", ""]
            ratio, push, frames = pulled(fabric, spacing, substeps)
            row += [f"{ratio:.3f}", frames, f"{push:.3f}", f"{weak(fabric, spacing, substeps):.3f}"]
        except (ValueError, RuntimeError, selvedge.FrameError) as error:
            row += [str(error)]
        rows.writerow([*row, f"{time.perf_counter() - began:.0f}"])
        output.flush()


if __name__ == "__main__":
    main()
