"""What the orders of docs/src/fits are fitted to: python fit_data.py

20 markers of a swing, with noise and gaps; a flat place on the floor; a towel folded in half.
"""

import csv
import pathlib

import numpy as np
import selvedge

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "fits"


def write(name, rows):
    with open(FOLDER / name, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["frame", "vertex", "x", "y", "z"])
        for frame, vertex, place in rows:
            table.writerow([frame, vertex, *(f"{x:.5f}" for x in place)])


def swing(rng, noise=1e-3, frames=60):
    cloth = selvedge.Simulator(selvedge.Scene(str(FOLDER / "swing-true.toml")))
    seen = sorted(rng.choice(len(cloth.positions), 20, replace=False))
    for frame in range(frames + 1):
        if frame:
            cloth.step()
        places = cloth.positions[seen] + noise * rng.standard_normal((20, 3))
        # One in ten is hidden.
        yield from ((frame, v, p) for v, p in zip(seen, places) if rng.random() > 0.1)


def flat(frame=60):
    """Where the sheet of throw-scene.toml is to lie, turned by 30° into the plane about (0.6, 0, 0.1)."""
    places = np.array(selvedge.Scene(str(FOLDER / "throw-scene.toml")).positions)
    places -= places.mean(axis=0)
    along = places @ [np.sin(np.pi / 3), -np.cos(np.pi / 3), 0]
    for vertex, (x, z) in enumerate(zip(along, places[:, 2])):
        yield frame, vertex, (0.6 + x, 0.0015, 0.1 + z)


def folded(frame=90):
    """The half of the towel with the handles on top of the other."""
    places = np.array(selvedge.Scene(str(FOLDER / "fold-scene.toml")).positions)
    middle = (places[:, 0].min() + places[:, 0].max()) / 2
    for vertex, (x, _, z) in enumerate(places):
        on_top = x < middle
        yield frame, vertex, (2 * middle - x if on_top else x, 0.006 if on_top else 0.002, z)


if __name__ == "__main__":
    write("swing-markers.csv", swing(np.random.default_rng(1)))
    write("throw-goal.csv", flat())
    write("fold-goal.csv", folded())
