"""Writes the meshes of the contact scenes beside it: cloths of several pieces, knots, a funnel and
needles. Needs nothing but Python 3, and only to make the meshes anew:

    python3 meshes.py FOLDER
"""

import sys
from math import ceil, cos, pi, sin, sqrt, tan
from pathlib import Path


class Mesh:
    """Triangles with the place of each vertex in its pattern; lengths in metres."""

    def __init__(self):
        self.lines, self.count = ["# Made by meshes.py (Selvedge). Metres, y up."], 0

    def grid(self, name, rows, columns, place, pattern=None, closed=False):
        """place(i, j) and pattern(i, j) of a grid of rows x columns vertices. The last column of a
        closed one is the first, with a seam in the pattern. Diagonals alternate."""
        first, width = self.count, columns + (1 if closed else 0)
        number = lambda i, j: first + i * columns + j % columns + 1
        self.lines.append(f"o {name}")
        for i in range(rows):
            for j in range(columns):
                self.lines.append("v %.6f %.6f %.6f" % tuple(place(i, j)))
        self.count += rows * columns
        if pattern:
            for i in range(rows):
                for j in range(width):
                    self.lines.append("vt %.6f %.6f" % tuple(pattern(i, j)))
            at = lambda i, j: f"{number(i, j)}/{self.textures + i * width + j + 1}"
        else:
            at = lambda i, j: f"{number(i, j)}"
        for i in range(rows - 1):
            for j in range(width - 1):
                a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)
                if (i + j) % 2:
                    self.lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
                else:
                    self.lines += [f"f {a} {b} {d}", f"f {b} {c} {d}"]
        if pattern:
            self.textures += rows * width

    textures = 0

    def body(self, name, points, faces):
        self.lines.append(f"o {name}")
        self.lines += ["v %.6f %.6f %.6f" % tuple(p) for p in points]
        self.lines += ["f " + " ".join(str(self.count + k + 1) for k in face) for face in faces]
        self.count += len(points)

    def write(self, path):
        Path(path).write_text("\n".join(self.lines) + "\n")


def pile(count, side, cells, spacing, turn):
    """Flat squares above each other, each turned a little farther than the one below."""
    mesh = Mesh()
    step = side / cells
    for k in range(count):
        c, s = cos(turn * k), sin(turn * k)

        def place(i, j):
            x, z = j * step - side / 2, i * step - side / 2
            return (c * x - s * z, k * spacing, s * x + c * z)

        mesh.grid(f"sheet-{k:02}", cells + 1, cells + 1, place, lambda i, j: (j * step, i * step))
    return mesh


def tube(radius, length, around, rows):
    """A cylinder along x about the origin."""
    mesh = Mesh()
    edge = 2 * pi * radius / around

    def place(i, j):
        angle = 2 * pi * j / around
        return (length * (i / (rows - 1) - 0.5), radius * cos(angle), radius * sin(angle))

    mesh.grid("tube", rows, around, place, lambda i, j: (j * edge, length * i / (rows - 1)), True)
    return mesh


# Vectors.
def add(a, b, s=1.0):
    return tuple(x + s * y for x, y in zip(a, b))


def sub(a, b):
    return add(a, b, -1.0)


def mul(a, s):
    return tuple(x * s for x in a)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(a):
    return mul(a, 1 / sqrt(dot(a, a)))


def smooth(points, rounds):
    """Corners cut, both ends kept (Chaikin 1974)."""
    for _ in range(rounds):
        made = [points[0]]
        for a, b in zip(points, points[1:]):
            made += [add(mul(a, 0.75), mul(b, 0.25)), add(mul(a, 0.25), mul(b, 0.75))]
        points = made + [points[-1]]
    return points


def resampled(points, count):
    """Points at equal distances along a line, and its length."""
    at = [0.0]
    for a, b in zip(points, points[1:]):
        at.append(at[-1] + sqrt(dot(sub(b, a), sub(b, a))))
    made, k = [], 0
    for n in range(count):
        want = at[-1] * n / (count - 1)
        while k < len(at) - 2 and at[k + 1] < want:
            k += 1
        t = (want - at[k]) / (at[k + 1] - at[k])
        made.append(add(mul(points[k], 1 - t), mul(points[k + 1], t)))
    return made, at[-1]


def ribbon(mesh, name, corners, width, across, across_first):
    """A ribbon along a smoothed line; its width is carried along without turning about it."""
    edge = width / (across - 1)
    line = smooth(corners, 5)
    _, length = resampled(line, 2)
    length = resampled(line, 4000)[1]
    count = ceil(length / edge) + 1
    line, length = resampled(line, count)
    side, sides = unit(across_first), []
    for k in range(count):
        along = unit(sub(line[min(k + 1, count - 1)], line[max(k - 1, 0)]))
        side = unit(sub(side, mul(along, dot(side, along))))
        sides.append(side)
    step = length / (count - 1)
    place = lambda i, j: add(line[i], sides[i], j * edge - width / 2)
    mesh.grid(name, count, across, place, lambda i, j: (j * edge, i * step))
    return count


def reef_knot(width=0.03, across=4):
    """Two bights, each led through the other: a reef knot, loose."""
    h, w = 0.06, 0.10  # half a height, half the distance of two legs
    mesh = Mesh()
    flat = [(-0.9, w, 0), (-0.4, w, 0), (0.1, w, 0), (0.24, w * 1.6, 0), (0.42, w, 0), (0.42, -w, 0),
            (0.24, -w * 1.6, 0), (0.1, -w, 0), (-0.4, -w, 0), (-0.9, -w, 0)]
    made = ribbon(mesh, "flat", flat, width, across, (0, 0, 1))
    half = [(0.9, 0.03, -h), (0.55, 0.03, -h), (0.36, 0.04, -h), (0.26, 0.05, 0.0), (0.12, 0.05, h),
            (-0.02, 0.10, h), (-0.06, 0.2, h), (-0.1, 0.22, 0.0), (-0.14, 0.2, -h), (-0.18, 0.1, -h)]
    through = half + [(x, -y, z) for x, y, z in reversed(half)]
    made += ribbon(mesh, "through", through, width, across, (0, 0, 1))
    print("reef knot:", made * across, "vertices", file=sys.stderr)
    return mesh


def overhand(width=0.024, across=4):
    """One ribbon with an overhand knot in it, loose."""
    mesh = Mesh()
    turns = 60
    line = []
    for k in range(turns + 1):
        t = -1.0 + 2.0 * k / turns
        # A loop and a half in the plane, over and under.
        angle = 1.0 * 2 * pi * t * 0.75
        line.append((0.16 * sin(2 * angle) * 0.9 + 0.35 * t ** 5, 0.16 * cos(angle) * 1.3 * (1 - 0.2 * t * t), 0.07 * sin(3 * angle)))
    made = ribbon(mesh, "ribbon", line, width, across, (0, 0, 1))
    print("overhand:", made * across, "vertices", file=sys.stderr)
    return mesh


def cards(width=0.06, height=0.0897, gap=0.0003):
    """A house of ten cards, 7 x 15 vertices each: three tents, two floors, a tent above.

    A floor has to bear on both cards of a tent: one that bears on the longer of two shears the tent
    unless friction is about 1. So the cards below are of one length and meet edge to edge. Above,
    where nothing bears on it, a longer card holds the edge of the other with its face. Gaps are
    about those at rest; what falls farther slides, and what is pressed together jumps."""
    mesh = Mesh()
    lean = 17.0 * pi / 180  # from upright
    columns, rows = 7, 15
    across = width / (columns - 1)
    number = 0

    def card(foot, side, length=height):
        """Leans to the left from the right `side`, 1, or to the right from the left one, -1;
        with a `side` of 0 it lies, from its foot across the middle."""
        nonlocal number
        up, direction = length / (rows - 1), (-side * sin(lean), cos(lean), 0)
        if side == 0:
            direction = (1.0 if foot[0] < 0 else -1.0, 0, 0)
        mesh.grid(f"card-{number}", rows, columns,
                  lambda i, j: add(add(foot, direction, i * up), (0, 0, 1), j * across - width / 2),
                  lambda i, j: (j * across, i * up))
        number += 1

    apart = 0.0006  # the cards of a tent at the top
    half = height * sin(lean) + apart / 2
    for k in (-1, 0, 1):
        middle = k * (2 * half + 0.004)
        card((middle + half, gap, 0), 1)
        card((middle - half, gap, 0), -1)
    # Each floor lies from tent to tent, and over the middle one they lie on each other.
    level, over = gap + height * cos(lean) + gap, 0.011
    card((over, level, 0), 0)
    card((-over, level + gap, 0), 0)
    # The right foot is on the upper floor, and the left one on the lower.
    card((half, level + 2 * gap, 0), 1, height + 0.004)
    top = half - (height * cos(lean) - gap) * tan(lean) - apart / cos(lean)
    card((top - height * sin(lean), level + gap, 0), -1)
    return mesh


def strip(width, length, columns, rows):
    """A strip that hangs from above the ground, bent a little so that it folds to one side."""
    mesh = Mesh()
    mesh.grid("strip", rows, columns,
              lambda i, j: (0.004 * sin(3 * pi * i / (rows - 1)), length * (1 - i / (rows - 1)) + 0.02,
                            width * (j / (columns - 1) - 0.5)),
              lambda i, j: (width * j / (columns - 1), -length * i / (rows - 1)))
    return mesh


def funnel(around=40):
    """An open funnel: a cone over a neck."""
    rings = [(0.10, -0.30), (0.10, -0.20), (0.10, -0.10)] + [(0.10 + 0.4 * k / 8, -0.10 + 0.35 * k / 8) for k in range(1, 9)]
    points = [(r * cos(2 * pi * (j + 0.5 * (i % 2)) / around), y, r * sin(2 * pi * (j + 0.5 * (i % 2)) / around))
              for i, (r, y) in enumerate(rings) for j in range(around)]
    faces = []
    for i in range(len(rings) - 1):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            c, d = a + around, b + around
            faces += [(a, c, b), (b, c, d)] if i % 2 else [(a, c, d), (a, d, b)]
    mesh = Mesh()
    mesh.body("funnel", points, faces)
    return mesh


def needles(count=10, pitch=0.1, height=0.25, radius=0.008, sides=6):
    """Upright cones in rows."""
    mesh = Mesh()
    for a in range(count):
        for b in range(count):
            x, z = (a - (count - 1) / 2) * pitch, (b - (count - 1) / 2) * pitch
            ring = [(x + radius * cos(2 * pi * k / sides), 0.0, z + radius * sin(2 * pi * k / sides)) for k in range(sides)]
            faces = [(k, sides, (k + 1) % sides) for k in range(sides)]
            faces += [(0, k, k + 1) for k in range(1, sides - 1)]
            mesh.body(f"needle-{a}-{b}", ring + [(x, height, z)], faces)
    return mesh


def plate(radius, height, around=24):
    """A round plate, its lower face at y = 0."""
    ring = lambda y: [(radius * cos(2 * pi * k / around), y, radius * sin(2 * pi * k / around)) for k in range(around)]
    points = ring(0.0) + ring(height) + [(0, 0, 0), (0, height, 0)]
    faces = []
    for k in range(around):
        n = (k + 1) % around
        faces += [(k, around + k, n), (n, around + k, around + n), (2 * around, k, n), (2 * around + 1, around + n, around + k)]
    mesh = Mesh()
    mesh.body("plate", points, faces)
    return mesh


def main():
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    folder.mkdir(parents=True, exist_ok=True)
    pile(10, 0.6, 16, 0.006, 0.35).write(folder / "stack.obj")
    pile(20, 0.4, 10, 0.004, 0.17).write(folder / "layers.obj")
    pile(3, 0.7, 31, 0.05, 0.5).write(folder / "three.obj")
    tube(0.2, 1.0, 50, 50).write(folder / "tube.obj")
    reef_knot().write(folder / "reef-knot.obj")
    cards().write(folder / "cards.obj")
    strip(0.15, 2.0, 8, 128).write(folder / "strip.obj")
    funnel().write(folder / "funnel.obj")
    needles().write(folder / "needles.obj")
    plate(0.1, 0.02).write(folder / "plate.obj")


main()
