"""Writes garments as other programs do: panels apart in the texture, sewn in space.

Each garment lies flat at the start, front over back, opened by a few millimetres. Texture
coordinates are the pattern in metres, unless the writer is asked for Blender's way. Needs nothing
but Python 3:

    python3 garments.py FOLDER             # every garment, each with a scene that hangs and swings it
    python3 garments.py FOLDER --broken    # the same files spoilt in ways that happen
    python3 garments.py FOLDER --flat      # a vest as flat panels with seams, which is sewn at the start
    python3 garments.py FOLDER --worn      # shirt, trousers and skirt, open around the mannequin

"""

import argparse
from math import cos, exp, pi, sin
from pathlib import Path

OPEN = 0.006  # half the distance between front and back, metres
SOFT = 0.05  # distance from a seam over which they come together


class Garment:
    """Quads by panel; vertices are shared by what they are called."""

    def __init__(self, name):
        self.name, self.places, self.numbers, self.faces = name, [], {}, []

    def vertex(self, key, place):
        if key not in self.numbers:
            self.numbers[key] = len(self.places)
            self.places.append(place)
        return self.numbers[key]

    def quad(self, panel, group, corners, fabric="Cotton"):
        """corners: (key, place, pattern point) counter-clockwise as seen from outside."""
        made = [(self.vertex(key, place), point) for key, place, point in corners]
        if len({vertex for vertex, _ in made}) == len(made):
            self.faces.append((panel, group, fabric, made))

    def write(self, path, blender=False, triangles=False):
        lines = ["# Made by garments.py (Selvedge). Metres, y up."]
        lines += [f"o {self.name}"] + ["v %.6f %.6f %.6f" % place for place in self.places]
        scale = 1.0
        if blender:
            points = [point for face in self.faces for _, point in face[3]]
            low = [min(p[k] for p in points) for k in (0, 1)]
            scale = 1 / max(max(p[k] for p in points) - low[k] for k in (0, 1))
        numbers, texture, body = {}, [], []
        last = (None, None)
        for panel, group, fabric, corners in self.faces:
            if (group, fabric) != last:
                body += [f"g {group}", f"usemtl {fabric}", "s 1"]
                last = (group, fabric)
            words = []
            for vertex, point in corners:
                if blender:
                    point = [(point[k] - low[k]) * scale for k in (0, 1)]
                text = "%.6f %.6f" % tuple(point)
                if (panel, text) not in numbers:
                    texture.append("vt " + text)
                    numbers[panel, text] = len(texture)
                words.append(f"{vertex + 1}/{numbers[panel, text]}")
            faces = [words]
            if triangles:
                faces = [[words[0], words[1], words[2]], [words[0], words[2], words[3]]]
            body += ["f " + " ".join(face) for face in faces]
        Path(path).write_text("\n".join(lines + texture + body) + "\n")


def layers(garment, cells, step, shared, pattern, group=lambda x, y: "body", fabric=None, depth=None):
    """Two layers of square cells in the plane: cells(side) gives (i, j), side 1 is the front.

    They are opened by a little, or by depth(i, j) to either side all over. shared(i, j): front and back have this vertex together. pattern(side, x, y): panel and point.
    """
    edge = [(i, j) for side in (1, -1) for a, b in cells(side) for i in (a, a + 1) for j in (b, b + 1)]
    seam = sorted({corner for corner in edge if shared(*corner)})

    def place(side, i, j):
        if shared(i, j):
            return (i * step, j * step, 0.0)
        if depth:
            return (i * step, j * step, side * depth(i, j))
        far = min(((i - a) ** 2 + (j - b) ** 2) ** 0.5 for a, b in seam) * step
        return (i * step, j * step, side * OPEN * (1 - exp(-((far / SOFT) ** 2))))

    for side in (1, -1):
        for i, j in cells(side):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            if side < 0:
                corners.reverse()
            middle = ((i + 0.5) * step, (j + 0.5) * step)
            made = []
            for a, b in corners:
                key = (a, b) if shared(a, b) else (a, b, side)
                made.append((key, place(side, a, b), pattern(side, a * step, b * step, *middle)[1]))
            panel = pattern(side, *middle, *middle)[0]
            name = fabric(panel) if fabric else "Cotton"
            garment.quad(panel, group(*middle), made, name)


def shirt(step=0.02, depth=None):
    """A T-shirt with set-in sleeves: front, back and two sleeves, ten seams."""
    width, height, arm, sleeve, neck = (round(x / step) for x in (0.5, 0.64, 0.2, 0.2, 0.18))
    half, top = width // 2, height

    def cells(side):
        depth = round((0.08 if side > 0 else 0.02) / step)
        body = [
            (i, j)
            for i in range(-half, half)
            for j in range(top)
            if not (-neck // 2 <= i < neck // 2 and j >= top - depth)
        ]
        arms = [
            (i, j)
            for i in list(range(-half - sleeve, -half)) + list(range(half, half + sleeve))
            for j in range(top - arm, top)
        ]
        return body + arms

    def shared(i, j):
        outside = abs(i) > half
        if outside:
            return j in (top - arm, top)
        on_side = abs(i) == half and j <= top - arm
        return on_side or (j == top and abs(i) >= neck // 2)

    def pattern(side, x, y, mx, my):
        if abs(mx) > half * step:
            # The back of a sleeve is unfolded over its top line.
            unfolded = y if side > 0 else 2 * top * step - y
            if mx > 0:
                return "sleeve-left", (x + 0.3, unfolded)
            return "sleeve-right", (x - 0.3, unfolded)
        # The back is drawn as it is cut: mirrored on the paper.
        return ("front", (x, y - 1.0)) if side > 0 else ("back", (2.0 - x, y - 1.0))

    garment = Garment("shirt")
    group = lambda x, y: "sleeves" if abs(x) > half * step else "body"
    fabric = lambda panel: "Sleeve rib" if panel.startswith("sleeve") else "Cotton"
    layers(garment, cells, step, shared, pattern, group, fabric, depth)
    return garment


def trousers(step=0.025, sizes=(0.25, 0.25, 0.7), depth=None, band=1.0):
    """Four panels: outer, inner, front and back seams. Half a leg around, rise and inner seam [m].
    The two upper rows are an elastic band, `band` times as long at rest."""
    leg, rise, inner = (round(x / step) for x in sizes)
    top = inner + rise

    def cells(side):
        upper = [(i, j) for i in range(-leg, leg) for j in range(inner, inner + rise)]
        lower = [(i, j) for i in range(-leg, leg) for j in range(inner)]
        return upper + lower

    garment = Garment("trousers")
    # Legs are apart by a hair: the key of an inner seam says whose leg it is.
    for which in (-1, 1):
        own = [c for c in cells(1) if (c[0] >= 0) == (which > 0)]

        def key(side, i, j):
            if i == 0:
                if j < inner:
                    return ("inner", which, j)
                return ("crotch", side, j) if j > inner else ("crotch", j)
            return ("outer", which, j) if abs(i) == leg else (i, j, side)

        def place(side, i, j):
            gap = 0.004 * which * min(1.0, (inner - j) * step / 0.1) if i == 0 and j < inner else 0.0
            across = min(leg - abs(i), abs(i) if j <= inner else leg) * step
            if depth:
                is_seam = across == 0 or (i == 0 and j <= inner)
                return (i * step + gap, j * step, 0.0 if is_seam else side * depth)
            return (i * step + gap, j * step, side * OPEN * (1 - exp(-((across / SOFT) ** 2))))

        for side in (1, -1):
            for i, j in own:
                corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                if side < 0:
                    corners.reverse()
                panel = f"{'front' if side > 0 else 'back'}-{'left' if which > 0 else 'right'}"
                shift = (1.2 if side > 0 else -1.2) + 0.4 * which
                is_band = band < 1.0 and j >= top - 2
                panel, wide = (panel + "-band", band * step) if is_band else (panel, step)
                made = [(key(side, a, b), place(side, a, b), (a * wide + shift, b * step)) for a, b in corners]
                garment.quad(panel, "waist" if j == top - 1 else "legs", made, "Denim")
    return garment


def skirt(step=0.025, each=9, tube=None, dart=0.035):
    """A straight skirt of one panel with four darts and a seam in the back; stands as a tube, of
    the half axes `tube` if they are given."""
    darts, rows, deep = 4, round(0.6 / step), round(0.15 / step)
    gore = each * step
    garment = Garment("skirt")

    def taken(j):
        return max(0.0, dart * (j - (rows - deep)) / deep)

    def corner(g, k, j):
        narrow = gore - taken(j)
        radius = darts * narrow / (2 * pi)
        column = (g * each + k) % (darts * each)
        angle = 2 * pi * column / (darts * each)
        across, along = tube or (radius, radius)
        place = (across * cos(angle), j * step, -along * sin(angle))
        # Each gore has half a dart on either side; below the darts they touch.
        return (column, j), place, (g * gore + taken(j) / 2 + k / each * narrow, j * step)

    for g in range(darts):
        for j in range(rows):
            for k in range(each):
                corners = [corner(g, k, j), corner(g, k + 1, j), corner(g, k + 1, j + 1), corner(g, k, j + 1)]
                garment.quad("skirt", "waist" if j == rows - 1 else "skirt", corners, "Wool")
    return garment


def cape(step=0.025):
    """A cape of half a circle with a hood of two mirrored panels, folded flat at the back seam."""
    neck, long, rise = 0.12, 0.55, 0.3
    columns, rows, hood = 24, round(long / step), round(rise / step)
    garment = Garment("cape")

    def arm(k):
        return pi * (0.05 + 0.45 * k / columns)  # from the open front to the middle of the back

    def flat(k, j):
        radius = neck + j * step
        return (-radius * cos(arm(k)) + 0.0, -radius * sin(arm(k)))

    def hooded(k, j):
        x, y = flat(k, 0)
        t = j / hood
        return (x * (1 + 0.35 * t), y * (1 - t) + rise * t)

    def corner(side, part, k, j):
        x, y = flat(k, j) if part == "cape" else hooded(k, j)
        # Middle of the back, and the top of the hood, are sewn.
        together = k == columns or (part == "hood" and j == hood)
        far = min((columns - k) * 0.03, (hood - j) * step if part == "hood" else 1.0)
        z = 0.0 if together else side * OPEN * (1 - exp(-((far / SOFT) ** 2)))
        key = (part if j else "neck", k, j, 0 if together else side)
        shift = (1.5, 0.0) if part == "cape" else (1.5, 1.5)
        # The right half is the mirror image on the paper too.
        return key, (x, y, z), (side * (x - shift[0]), y + shift[1])

    for side in (1, -1):
        for part, count in (("cape", rows), ("hood", hood)):
            for j in range(count):
                for k in range(columns):
                    square = [(k, j), (k, j + 1), (k + 1, j + 1), (k + 1, j)]
                    if (side < 0) != (part == "hood"):
                        square.reverse()
                    panel = f"{part}-{'left' if side > 0 else 'right'}"
                    group = "crown" if part == "hood" and j == hood - 1 else part
                    fabric = "Lining" if part == "hood" else "Loden"
                    garment.quad(panel, group, [corner(side, part, a, b) for a, b in square], fabric)
    return garment


SCENE = """# A {name} that is hung up, swung, and left to come to rest.
name = "{name}"
mesh = {{ file = "{file}"{options} }}
material = "gray-interlock"
handles = {{ {handles} }}
start = "mesh"
motion = {{ inline = {{ kind = "keyframes", duration = 12.0, groups = [{{ handles = [{all}], keyframes = [
    {{ time = 2.0 }}, {{ time = 2.75, translation = [0.25, 0, 0.15] }}, {{ time = 3.5 }} ] }}] }} }}
"""


def box(garment, inside):
    chosen = [place for place in garment.places if inside(*place)]
    low = [min(p[k] for p in chosen) - 1e-4 for k in range(3)]
    high = [max(p[k] for p in chosen) + 1e-4 for k in range(3)]
    chosen = [p for p in garment.places if all(a <= x <= b for a, x, b in zip(low, p, high))]
    return "box = { min = [%.4f, %.4f, %.4f], max = [%.4f, %.4f, %.4f] }" % (*low, *high), len(chosen)


def scene(folder, garment, name, file, inside, options=""):
    handles, count = box(garment, inside)
    every = ", ".join(str(k) for k in range(count))
    text = SCENE.format(name=name, file=file, options=options, handles=handles, all=every)
    (folder / f"{name}.toml").write_text(text)


def everything(folder):
    made = [
        (shirt(), lambda x, y, z: y > 0.6399 and 0.08 < abs(x) < 0.26),
        (trousers(), lambda x, y, z: y > 0.9499),
        (skirt(), lambda x, y, z: y > 0.5999),
        (cape(), lambda x, y, z: y > 0.2999),
    ]
    for garment, inside in made:
        garment.write(folder / f"{garment.name}.obj")
        scene(folder, garment, garment.name, f"{garment.name}.obj", inside)
    fine, inside = shirt(0.016), made[0][1]
    fine.write(folder / "blender-shirt.obj", blender=True)
    scene(folder, fine, "blender-shirt", "blender-shirt.obj", inside, ', texture = "fit"')


def broken(folder):
    garment = shirt()
    garment.write(folder / "good.obj")
    text = (folder / "good.obj").read_text().splitlines()

    def save(name, lines):
        (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
        scene(folder, garment, name, f"{name}.obj", lambda x, y, z: y > 0.6399 and 0.08 < abs(x) < 0.26)

    # Panels that were drawn much too small: edges many times as long as their pattern.
    shrunk = []
    for line in text:
        words = line.split()
        if words and words[0] == "vt" and float(words[1]) > 1.0:
            line = "vt %.6f %.6f" % (float(words[1]) / 36, float(words[2]) / 36)
        shrunk.append(line)
    save("shrunk-back", shrunk)
    # One vertex that was dragged away by mistake.
    dragged = list(text)
    row = next(k for k, line in enumerate(dragged) if line.startswith("v "))
    dragged[row + 300] = "v 1.3 -0.9 0.4"
    save("dragged-vertex", dragged)
    # A collar of a second layer on the same edge as the shirt's own two.
    faces = [k for k, line in enumerate(text) if line.startswith("f ")]
    first = text[faces[40]].split()[1:3]
    vertices = sum(line.startswith("v ") for line in text)
    collar = text[: faces[0]] + ["v 0 1 0.3"] + text[faces[0] :]
    save("collar", collar + [f"f {first[0]} {first[1]} {vertices + 1}/1"])
    # Loose vertices, as are left behind after deleting faces.
    save("loose-vertices", text + ["v 5 5 5"] * 3)


VEST = """# A vest of two flat panels, sewn at the shoulders and sides, that is hung up and swung.
name = "vest"
material = "gray-interlock"
handles = { label = "back-right-shoulder" }
start = "fit"
mesh = { file = "vest.obj", panels = [
    { panel = "front", translation = [0, 0, 0.15] },
    { panel = "back", angle_deg = 180, translation = [1.5, 0, -0.15] },   # to face away from the front
] }
seams = [
    { a = "front-left-side", b = "back-left-side", resample = true },
    { a = "front-right-side", b = "back-right-side", resample = true },
    { a = "front-left-shoulder", b = "back-left-shoulder" },
    { a = "front-right-shoulder", b = "back-right-shoulder" },
]
motion = { inline = { kind = "keyframes", duration = 12.0, groups = [{ handles = [HANDLES], keyframes = [
    { time = 2.0 }, { time = 2.75, translation = [0.25, 0, 0.15] }, { time = 3.5 } ] }] } }
"""


def vest(folder):
    """Front and back lie side by side in a plane; the back has more rows, as another hand cut it."""
    lines, faces, borders = ["# Made by garments.py (Selvedge). Metres; a flat pattern."], [], []
    total = 0
    for panel, shift, rows in (("front", 0.0, 30), ("back", 1.5, 36)):
        columns, width, height = 24, 0.5, 0.6
        first = total
        lines.append(f"g {panel}")
        for j in range(rows + 1):
            for i in range(columns + 1):
                x, y = (i / columns - 0.5) * width, j / rows * height
                # The neck is cut deep in the front and shallow in the back.
                depth = 0.12 if panel == "front" else 0.03
                y -= depth * max(0.0, 1 - (x / 0.12) ** 2) * (j / rows) ** 2
                lines.append("v %.6f %.6f 0" % (x + shift, y))
                total += 1
        number = lambda i, j: first + j * (columns + 1) + i + 1
        faces.append(f"g {panel}")
        for j in range(rows):
            for i in range(columns):
                corners = (number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1))
                faces.append("f %d %d %d %d" % corners)
        # The arm's opening is the upper third of a side; the neck is the middle of the top.
        side, neck = rows * 2 // 3, round(0.12 / width * columns)
        turn = -1 if panel == "back" else 1
        for name, i in (("left", columns if turn > 0 else 0), ("right", 0 if turn > 0 else columns)):
            borders.append((f"{panel}-{name}-side", [number(i, j) for j in range(side + 1)]))
            to_neck = range(0, columns // 2 - neck + 1) if i == 0 else range(columns // 2 + neck, columns + 1)
            borders.append((f"{panel}-{name}-shoulder", [number(k, rows) for k in to_neck]))
    for name, vertices in borders:
        faces += [f"g {name}", "l " + " ".join(map(str, vertices))]
    (folder / "vest.obj").write_text("\n".join(lines + faces) + "\n")
    count = len(dict(borders)["back-right-shoulder"])
    handles = ", ".join(str(k) for k in range(count))
    (folder / "vest.toml").write_text(VEST.replace("HANDLES", handles))


WORN = """# {what}, put on by the mannequin, which turns and raises its arms. The garment stands open
# around it at the start, and is fitted there.
name = "{name}"
mesh = {{ file = "{name}.obj", transform = {{ translation = [0, {height}, 0] }} }}
material = "gray-interlock"
handles = {{ vertices = [] }}
start = "fit"
motion = {{ inline = {{ kind = "keyframes", duration = 5.0, groups = [] }} }}
contact = {{ friction = 0.5 }}
obstacles = [{{ name = "mannequin", mesh = "mannequin", motion = {{ animation = "wear" }} }}]
"""


def worn(folder):
    # Half the depth of the mannequin and a little more; less where its arms are.
    body = shirt(depth=lambda i, j: 0.15 if abs(i) <= 12 else 0.09)
    legs = trousers(sizes=(0.3, 0.25, 0.625), depth=0.17, band=0.62)
    around = skirt(each=10, tube=(0.22, 0.16), dart=0.058)
    for garment, what, height in ((body, "A T-shirt", 0.82), (legs, "Trousers", 0.155), (around, "A skirt", 0.455)):
        garment.write(folder / f"{garment.name}.obj")
        text = WORN.format(name=garment.name, what=what, height=height)
        (folder / f"{garment.name}.toml").write_text(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the files go; it is made")
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--broken", action="store_true", help="garments with faults instead")
    kinds.add_argument("--flat", action="store_true", help="a pattern of flat panels and its scene instead")
    kinds.add_argument("--worn", action="store_true", help="garments around the shipped mannequin instead")
    wanted = parser.parse_args()
    wanted.folder.mkdir(parents=True, exist_ok=True)
    if wanted.broken:
        broken(wanted.folder)
    elif wanted.flat:
        vest(wanted.folder)
    elif wanted.worn:
        worn(wanted.folder)
    else:
        everything(wanted.folder)
