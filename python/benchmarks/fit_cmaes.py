"""Runs that CMA-ES needs for an order of `selvedge fit`: the same numbers, bounds, scales, start and value.

    pip install cma
    selvedge fit docs/src/fits/swing.toml -o out/swing
    python python/benchmarks/fit_cmaes.py docs/src/fits/swing.toml out/swing/fit.json --seeds 10

It knows the numbers of material and environment that are no tables of entries, from markers. Counted are
runs until the value is within one per cent of that of the fit, and until it is that of the fit itself.
"""

import argparse
import csv
import json
import math
import pathlib
import tomllib

import cma
import numpy as np
import selvedge


class Swing:
    def __init__(self, order):
        order = pathlib.Path(order)
        file = tomllib.loads(order.read_text())
        self.text = (order.parent / file["scene"]).read_text()
        self.scene = selvedge.Scene.parse(self.text)
        with open(order.parent / file["data"]["markers"]) as table:
            rows = list(csv.DictReader(table))
        self.at = np.array([[int(row["frame"]), int(row["vertex"])] for row in rows])
        self.seen = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
        fabric = self.scene.material.to_dict()
        self.fabric = fabric
        self.numbers = []
        for name, bounds in file["material"].items():
            assert name in ("stretch", "bend", "density"), name
            self.numbers.append((name, bounds, fabric["density"] if name == "density" else 1.0))

    def start(self):
        return [math.log(first / low) / math.log(high / low) for _, (low, high), first in self.numbers]

    def values(self, parts):
        return {name: low * (high / low) ** part for part, (name, (low, high), _) in zip(parts, self.numbers)}

    def value(self, parts):
        """Mean square distance of a coordinate [mm²]."""
        values, fabric = self.values(parts), dict(self.fabric)
        for name in ("stretch", "bend"):
            fabric[name] = (np.array(fabric[name]) * values.get(name, 1.0)).tolist()
        fabric["density"] = values.get("density", fabric["density"])
        scene = self.scene.with_material(selvedge.Material.from_dict(fabric))
        try:
            cloth = selvedge.Simulator(scene)
            frames = [cloth.state_positions()]
            for _ in range(self.at[:, 0].max()):
                cloth.step()
                frames.append(cloth.state_positions())
        except selvedge.SelvedgeError:
            return 1e6
        miss = np.stack(frames)[self.at[:, 0], self.at[:, 1]] - self.seen
        return 1e6 * (miss**2).mean()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("order")
    parser.add_argument("fit")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--most", type=int, default=3000)
    args = parser.parse_args()
    swing = Swing(args.order)
    fit = json.loads(pathlib.Path(args.fit).read_text())
    first, last = fit["searches"][0]
    goal = last**2
    print(f"fit: {last:.4f} mm, {fit['runs']} runs forward and {fit['runs_back']} back")
    print(f"the same start: {math.sqrt(swing.value(swing.start())):.3f} mm, "
          f"the fit has {first:.3f} mm")
    counts = []
    for seed in range(1, args.seeds + 1):
        options = {"bounds": [0, 1], "seed": seed, "verbose": -9, "maxfevals": args.most}
        search = cma.CMAEvolutionStrategy(swing.start(), 0.2, options)
        runs, reached = 0, {}
        while len(reached) < 2 and runs < args.most and not search.stop():
            tried = search.ask()
            values = []
            for parts in tried:
                values.append(swing.value(parts))
                runs += 1
                for name, factor in (("near", 1.01), ("same", 1.0 + 1e-4)):
                    if values[-1] <= goal * factor:
                        reached.setdefault(name, runs)
            search.tell(tried, values)
        found = ", ".join(f"{name} {value:.4f}" for name, value in swing.values(search.result.xbest).items())
        print(f"seed {seed}: within 1 % after {reached.get('near')}, 0.01 % after {reached.get('same')}, "
              f"{runs} runs in all: {found}", flush=True)
        counts.append([reached.get("near", math.nan), reached.get("same", math.nan)])
    near, same = np.nanmean(np.array(counts, dtype=float), axis=0)
    print(f"mean: {near:.0f} and {same:.0f} runs")


if __name__ == "__main__":
    main()
