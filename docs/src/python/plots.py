"""Draws an evaluation or a training: python plots.py FOLDER/errors.csv|log.jsonl OUT.svg

Of an evaluation the position error after k frames from true states, and of whole runs by time in frames,
each the root of the mean square over starts and cases (figures 3a and 3b of Libao et al. 2023); of a
training its loss. It needs matplotlib.
"""

import csv
import json
import sys
from collections import defaultdict

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

source, out = sys.argv[1:]
if source.endswith(".jsonl"):
    with open(source) as lines:
        log = [json.loads(line) for line in lines if line.endswith("\n")]
    figure, axes = plt.subplots()
    axes.semilogy([row["step"] for row in log], [row["loss"] for row in log])
    axes.set(xlabel="step", ylabel="loss")
else:
    squares = defaultdict(lambda: defaultdict(list))
    with open(source, newline="") as table:
        for row in csv.DictReader(table):
            if row["position_rmse"]:
                line = squares[row["whole"] == "true", row["method"]]
                line[int(row["frame"])].append(float(row["position_rmse"]) ** 2)
    figure, both = plt.subplots(1, 2, figsize=(12, 5))
    for (is_whole, method), line in sorted(squares.items()):
        frames = sorted(line)
        errors = [1e3 * (sum(line[k]) / len(line[k])) ** 0.5 for k in frames]
        both[int(is_whole)].plot(frames, errors, marker="" if is_whole else "o", label=method)
    both[0].set(xlabel="frames k from true states", xscale="log")
    for axes in both:
        axes.set(ylabel="position RMSE (mm)", yscale="log")
        axes.legend()
    both[1].set(xlabel="frame of whole runs")
figure.tight_layout()
figure.savefig(out)
