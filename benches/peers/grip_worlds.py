"""A towel of 900 vertices between two fingers, in many worlds: Selvedge beside MuJoCo's flex.

    pip install ./python mujoco==4.0.0 && python benches/peers/grip_worlds.py --output grip.csv

The towel is that of MuJoCo's ALOHA scene with cloth (mujoco_warp, benchmarks/aloha/scene_cloth.xml, with fingers and
options of mujoco_menagerie's aloha.xml): 30 by 30 vertices 14 mm apart, 0.1 kg, friction 1. Two boxes of 30 mm close on
the middle of its upper edge in 0.4 s; it is free to fall from 0.5 s on, is lifted by 30 cm in 1 s, and shaken up and down
at 2 m/s² and 3 Hz until 3.5 s. The fingers go where they are led to, the same way in all.

- selvedge: an isotropic sheet of the same grid, held by its upper edge until 0.5 s.
- flex-sheet: the same law and constants, MuJoCo's discrete integrator, elliptic cone; without gravity until 0.5 s.
- flex-aloha: elasticity, edge constraints, solver, cone, time step and fingers' contact of the ALOHA scene.
- ...-tied: no contact; the vertices between the fingers are tied to the arm by `connect`, since the grip by contact slips.

A step is a frame of 1/60 s of one world. Its time is processor time from 0.5 s on, of all threads, without what is
measured here: on a machine with nothing else on it, two cores do 2000 / (ms per frame) frames per second.
"""

import argparse
import csv
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

RATE, LOOSE, END = 60, 0.5, 3.5
COUNT, SPACING, MASS, FRICTION = 30, 0.014, 0.1, 1.0
SIDE = (COUNT - 1) * SPACING
PAD, DEPTH, OPEN = 0.03, 0.02, 0.04
YOUNG, POISSON, THICKNESS, DAMPING = 3e5, 0.3, 1e-3, 1e-3


def smooth(part):
    part = np.clip(part, 0.0, 1.0)
    return 3 * part**2 - 2 * part**3


def raised(seconds):
    """How far the fingers are up [m]."""
    rate = 2 * np.pi * 3.0
    shaken = 2.0 / rate**2 * np.sin(rate * (seconds - 1.8)) if seconds > 1.8 else 0.0
    return 0.3 * smooth((seconds - 0.6) / 1.0) + shaken


def closed(seconds):
    """How far they are closed, 0 to 1."""
    return smooth(seconds / 0.4)


class Measure:
    """What becomes of the towel, which is lost where it is 10 cm below the fingers; `positions` have the height in column `up`."""

    def __init__(self, positions, edges, up):
        self.edges, self.up, self.most, self.now = edges, up, 0.0, 0.0
        self.lengths = self._lengths(positions)
        self.top = positions[:, up].max()
        middle = np.abs(positions[:, 3 - up if up == 1 else 1])
        self.between = np.flatnonzero((positions[:, up] > self.top - DEPTH - PAD / 2) & (middle < PAD / 2))
        self.held_at = positions[self.between, up].mean()
        self.lost, self.slip = None, 0.0

    def _lengths(self, positions):
        return np.linalg.norm(positions[self.edges[:, 0]] - positions[self.edges[:, 1]], axis=1)

    def see(self, positions, seconds):
        """Strain of edges at the end of a frame, and whether the fingers still have it."""
        self.now = float((self._lengths(positions) / self.lengths - 1).max())
        if seconds > LOOSE:
            self.most = max(self.most, self.now)
        low = positions[self.between, self.up].mean() - self.held_at - raised(seconds)
        self.slip = -1e3 * low
        if self.lost is None and not low > -0.1:
            self.lost = seconds


def selvedge_worlds(substeps, worlds):
    import selvedge

    scene = selvedge.Scene.parse(f"""
        name = "towel"
        material = {{ name = "sheet", density = {MASS / SIDE**2}, damping = {DAMPING}, isotropic = {{ youngs_modulus = {YOUNG}, poissons_ratio = {POISSON}, thickness = {THICKNESS} }} }}
        mesh = {{ generator = {{ kind = "square", vertices = 9, size = {SIDE}, seed = 1 }} }}
        start = "mesh"
        environment = {{ air_density = 0 }}
        physics = {{ substeps = {substeps} }}
        contact = {{ thickness = 0.001, friction = {FRICTION}, self = false }}
        obstacles = [
            {{ name = "left", box = {{ size = [0.02, {PAD}, {PAD}] }}, transform = {{ translation = [-{OPEN}, -{DEPTH}, 0] }} }},
            {{ name = "right", box = {{ size = [0.02, {PAD}, {PAD}] }}, transform = {{ translation = [{OPEN}, -{DEPTH}, 0] }} }},
        ]""")
    # The grid of flex, hung in the plane x = 0 below y = 0.
    rows, columns = (k.ravel() for k in np.mgrid[:COUNT, :COUNT])
    flat = np.stack([columns - (COUNT - 1) / 2, -rows], axis=1) * SPACING
    first = (COUNT * rows + columns)[(rows < COUNT - 1) & (columns < COUNT - 1)][:, None]
    faces = np.concatenate([first + [0, COUNT, COUNT + 1], first + [0, COUNT + 1, 1]])
    places = np.stack([0 * flat[:, 0], flat[:, 1], flat[:, 0]], axis=1)
    scene = scene.with_mesh(selvedge.Mesh(places, faces, flat), list(range(COUNT)))
    all_worlds = selvedge.Worlds([scene] * worlds)
    positions = all_worlds.positions
    held = positions[:, scene.handles].copy()
    sides = np.sort(np.concatenate([scene.faces[:, k] for k in ([0, 1], [1, 2], [2, 0])]), axis=1)
    measure, spent = Measure(positions[0].copy(), np.unique(sides, axis=0), 1), 0.0
    for frame in range(1, round(END * RATE) + 1):
        seconds = frame / RATE
        began = time.process_time()
        for world in range(worlds):
            for body, sign in enumerate((1, -1)):
                pose = np.eye(4)
                # To a gap of 0.3 mm on each side.
                pose[:3, 3] = [sign * (OPEN - 0.0103) * closed(seconds), raised(seconds), 0.0]
                all_worlds.lead_body(world, body, pose)
        errors = all_worlds.step(held, [[seconds > LOOSE] * held.shape[1]] * worlds)
        spent += (time.process_time() - began) * (seconds > LOOSE)
        if any(errors):
            raise RuntimeError(next(error for error in errors if error))
        measure.see(all_worlds.positions[0], seconds)
        if measure.lost:
            break
    return spent / (frame - LOOSE * RATE), measure


def flex_model(kind, steps, is_tied, finger):
    import mujoco

    def text(tied):
        fingers = "".join(
            f"""<body name="{name}" pos="{sign * OPEN} 0 0"><joint type="slide" axis="{-sign} 0 0"/>
            <geom type="box" size="0.01 {PAD / 2} {PAD / 2}" mass="1" priority="1" friction="{FRICTION} 0.005 0.0001" {finger}/>
            </body>"""
            for name, sign in (("left", -1), ("right", 1))
        )
        ties = "".join(f'<connect body1="{name}" body2="arm" anchor="0 0 0" solref="{2 / RATE / steps} 1" solimp="0.9999 0.9999 0.001"/>' for name in tied)
        if kind == "aloha":
            option = f'timestep="{1 / RATE / steps}" solver="CG" tolerance="1e-6" cone="pyramidal" impratio="10"'
            elastic = '<edge equality="true"/><elasticity young="3e3" poisson="0" thickness="1e-2" damping="1e-3" elastic2d="bend"/>'
        else:
            option = f'timestep="{1 / RATE / steps}" solver="CG" cone="elliptic" integrator="discrete" impratio="100"'
            elastic = f'<elasticity young="{YOUNG}" poisson="{POISSON}" thickness="{THICKNESS}" damping="{DAMPING}" elastic2d="both"/>'
        return f"""<mujoco><option {option} jacobian="sparse"/><size memory="400M"/><worldbody>
            <body name="arm" pos="0 0 {SIDE / 2 - DEPTH}"><joint type="slide" axis="0 0 1"/>
            <geom type="sphere" size="0.001" mass="1" contype="0" conaffinity="0"/>{fingers}</body>
            <flexcomp name="towel" type="grid" count="{COUNT} {COUNT} 1" spacing="{SPACING} {SPACING} {SPACING}" radius="0.006"
            dim="2" euler="0 90 0" mass="{MASS}"><contact selfcollide="none"/>{elastic}</flexcomp></worldbody>
            <equality>{ties}</equality></mujoco>"""

    model = mujoco.MjModel.from_xml_string(text([]))
    if is_tied:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        between = Measure(data.flexvert_xpos, model.flex_edge, 2).between
        names = [model.body(int(model.flex_vertbodyid[k])).name for k in between]
        model = mujoco.MjModel.from_xml_string(text(names))
    return model


# Contact of the fingers: of ALOHA's, and one that presses harder, with less depth.
ALOHA_FINGER = 'condim="4" solimp="2 1 0.01" solref="0.01 1"'
# How deep the fingers' faces go into the flex' radius of 6 mm [m].
DEEP = 0.0015


def flex_worlds(kind, steps, worlds, threads, is_tied, finger):
    import mujoco

    models = [flex_model(kind, steps, is_tied, finger) for _ in range(worlds)]
    datas = [mujoco.MjData(model) for model in models]
    for model, data in zip(models, datas):
        mujoco.mj_forward(model, data)
    gravity = models[0].opt.gravity.copy()
    measure, spent = Measure(datas[0].flexvert_xpos.copy(), models[0].flex_edge, 2), 0.0
    step = 1 / RATE / steps

    def frame_of(number, frame):
        model, data = models[number], datas[number]
        for k in range(steps):
            now = ((frame - 1) * steps + k) * step
            begin, end = ([raised(t), *[(OPEN - 0.016 + DEEP) * closed(t)] * 2] for t in (now, now + step))
            data.qpos[:3], data.qvel[:3] = begin, np.subtract(end, begin) / step
            model.opt.gravity[:] = gravity if now + step > LOOSE else 0.0
            mujoco.mj_step(model, data)

    with ThreadPoolExecutor(threads) as pool:
        for frame in range(1, round(END * RATE) + 1):
            began = time.process_time()
            list(pool.map(lambda number: frame_of(number, frame), range(worlds)))
            spent += (time.process_time() - began) * (frame / RATE > LOOSE)
            positions = datas[0].flexvert_xpos
            measure.see(positions, frame / RATE)
            if measure.lost or not np.isfinite(positions).all():
                break
    return spent / (frame - LOOSE * RATE), measure


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=2)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--methods", nargs="+", default=["selvedge-1", "selvedge-2", "selvedge-4", "flex-sheet-4",
                        "flex-sheet-tied-1", "flex-sheet-tied-2", "flex-sheet-tied-4", "flex-aloha-8", "flex-aloha-tied-8"],
                        help="a method and its steps per frame")
    parser.add_argument("--output", default=None)
    chosen = parser.parse_args()
    output = open(chosen.output, "a", newline="") if chosen.output else sys.stdout
    rows = csv.writer(output)
    rows.writerow("method,steps per frame,ms per frame,frames per s on two cores,largest strain,strain at the end,slip at the end mm,held until s".split(","))
    for name in chosen.methods:
        method, steps = name.rsplit("-", 1)
        try:
            if method == "selvedge":
                spent, measure = selvedge_worlds(int(steps), chosen.worlds)
            else:
                kind = method.split("-")[1]
                is_tied = method.endswith("tied")
                finger = 'contype="0" conaffinity="0"' if is_tied else ALOHA_FINGER if kind == "aloha" else f'condim="3" solref="{2 / RATE / int(steps)} 1" solimp="0.99 0.99 0.001"'
                spent, measure = flex_worlds(kind, int(steps), chosen.worlds, chosen.threads, is_tied, finger)
        except (RuntimeError, ValueError) as error:
            rows.writerow([method, steps, str(error)])
        else:
            each = 1e3 * spent / chosen.worlds
            until = END if measure.lost is None else measure.lost
            rows.writerow([method, steps, f"{each:.2f}", f"{2000 / each:.0f}", f"{measure.most:.3f}", f"{measure.now:.3f}", f"{measure.slip:.1f}", f"{until:.2f}"])
        output.flush()


if __name__ == "__main__":
    main()
