"""Draws the table of docs/src/peers.md, error against time of the swinging sheet, as an SVG.

    python3 benches/peers/chart.py     # writes docs/src/images/peers.svg
"""

import math
import pathlib

BOOK = pathlib.Path(__file__).parents[2] / "docs" / "src"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 760, 430, 64, 24, 64, 52
X, Y = (2.0, 400.0), (4.0, 1000.0)  # ms per frame, mm
INK, GREY = "#2b3442", "#8b93a1"
COLOURS = {
    "Selvedge": "#c2402f",
    "MuJoCo flex": "#3a609e",
    "Newton VBD": "#6b8f3a",
    "Newton Style3D": "#3d8f7c",
    "Blender": "#d08a2e",
    "Rapier constraints": "#8a5a9e",
    "Rapier FEM": "#b07aa8",
    "rapier-cloth-core XPBD": "#6d7683",
    "rapier-cloth-core implicit": "#3f4754",
}
# Where the name stands: beside which point of the line, how far off, and its anchor.
NAMES = {
    "Selvedge": (0, 10, -8, "start"),
    "MuJoCo flex": (2, 9, -2, "start"),
    "Newton VBD": (0, 8, -6, "start"),
    "Newton Style3D": (0, 4, -10, "middle"),
    "Blender": (2, -2, 20, "middle"),
    "Rapier constraints": (0, -2, -9, "middle"),
    "Rapier FEM": (0, 8, 2, "start"),
    "rapier-cloth-core XPBD": (2, 10, 10, "start"),
    "rapier-cloth-core implicit": (2, 0, 18, "end"),
}


def rows():
    """Method, and ms per frame and error after half a second of the sheet, by its lines."""
    lines = {}
    for line in (BOOK / "peers.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] in COLOURS and len(cells) == 8:
            errors = [float(number) for number in cells[3].split(",")]
            lines.setdefault(cells[0], []).append((float(cells[2]), errors[1]))
    assert lines.keys() == COLOURS.keys(), lines.keys()
    return lines


def place(value, bounds, low, high):
    share = math.log(value / bounds[0]) / math.log(bounds[1] / bounds[0])
    return low + share * (high - low)


def at(point):
    x = place(point[0], X, LEFT, WIDTH - RIGHT)
    y = place(point[1], Y, HEIGHT - BOTTOM, TOP)
    return x, y


def text(x, y, words, anchor="start", size=13, colour=INK, weight="normal"):
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}"'
        f' font-weight="{weight}" fill="{colour}">{words}</text>'
    )


def main():
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="system-ui, sans-serif">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
        text(LEFT - 44, 24, "Error against time: a swinging sheet of 1024 vertices", size=16, weight="600"),
        text(LEFT - 44, 44, "Each method against its own converged motion, on one thread; lower left is better", colour=GREY),
    ]
    for value in (2, 5, 10, 20, 50, 100, 200, 400):
        x, _ = at((value, Y[0]))
        parts.append(f'<path d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#e6e8ec"/>')
        parts.append(text(x, HEIGHT - BOTTOM + 18, value, "middle", 12, GREY))
    for value in (5, 10, 20, 50, 100, 200, 500, 1000):
        _, y = at((X[0], value))
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#e6e8ec"/>')
        parts.append(text(LEFT - 8, y + 4, value, "end", 12, GREY))
    parts.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, "processor time per frame [ms]", "middle"))
    parts.append(
        f'<g transform="translate(18 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)">'
        + text(0, 0, "RMSE after 0.5 s [mm]", "middle")
        + "</g>"
    )
    for method, points in rows().items():
        colour, own = COLOURS[method], method == "Selvedge"
        places = [at(point) for point in points]
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
        parts.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="{3.5 if own else 2}"/>')
        for x, y in places:
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{5 if own else 3.5}" fill="{colour}"/>')
        beside, right, down, anchor = NAMES[method]
        x, y = places[beside]
        weight = "600" if own else "normal"
        parts.append(text(x + right, y + down, method, anchor, 12, colour, weight))
    parts.append("</svg>\n")
    (BOOK / "images" / "peers.svg").write_text("\n".join(parts))


if __name__ == "__main__":
    main()
