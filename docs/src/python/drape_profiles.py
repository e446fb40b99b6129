"""Draws profiles of measured and simulated drapes as SVG:
python drape_profiles.py profiles.csv FABRIC drapes.json > profiles.svg

profiles.csv has a column fabric and r0, r5 ... r355 [mm]; drapes.json is what `selvedge drape test
FABRIC.toml --json` prints."""

import csv
import json
import math
import sys

MEASURED, SIMULATED = "#b5523f", "#3f6fb5"


def path(radii, middle, colour):
    """A closed curve through radii [mm] at even angles."""
    turns = [2 * math.pi * k / len(radii) for k in range(len(radii))]
    points = " ".join(f"{middle + r * math.cos(a):.1f},{160 + r * math.sin(a):.1f}" for r, a in zip(radii, turns))
    return f'<polygon points="{points}" fill="none" stroke="{colour}" stroke-opacity="0.5"/>'


def main(profiles, fabric, drapes):
    with open(profiles) as file:
        rows = [row for row in csv.DictReader(file) if row["fabric"] == fabric]
    measured = [[float(row[f"r{k}"]) for k in range(0, 360, 5)] for row in rows]
    with open(drapes) as file:
        simulated = [drape["profile"] for drape in json.load(file)["fabrics"][0]["drapes"]]
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 340">']
    every = max(1, len(measured) // len(simulated))
    for middle, radii, colour in [(160, measured[::every], MEASURED), (480, [[1e3 * r for r in p] for p in simulated], SIMULATED)]:
        lines += [f'<circle cx="{middle}" cy="160" r="{r}" fill="none" stroke="#999"/>' for r in (90, 150)]
        lines += [path(profile, middle, colour) for profile in radii[: len(simulated)]]
    for x, text in [(160, f"measured, fabric {fabric}"), (480, "simulated")]:
        lines.append(f'<text x="{x}" y="334" font-family="sans-serif" font-size="14" text-anchor="middle">{text}</text>')
    print("\n".join([*lines, "</svg>"]))


if __name__ == "__main__":
    main(*sys.argv[1:])
