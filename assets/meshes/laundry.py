"""Writes laundry.obj: three pieces of cloth in the way in which modelling programs export them.

Quads, normals, objects, smoothing groups, and texture coordinates from 0 to 1 on every piece, so that
the pieces overlap in the texture; the tube is closed and has a seam. Needs nothing but Python 3:

    python3 laundry.py > laundry.obj
"""

from math import cos, pi, sin


class Writer:
    def __init__(self):
        self.lines = ["# Made by laundry.py (Selvedge). Metres, y up.", "mtllib laundry.mtl"]
        self.vertices = self.textures = self.normals = 0

    def grid(self, name, columns, rows, point, closed=False):
        """A grid of quads; point(s, t), s and t from 0 to 1, gives a position and its normal."""
        ring = columns if closed else columns + 1
        self.lines.append(f"o {name}")
        places = [point(i / columns, j / rows) for j in range(rows + 1) for i in range(ring)]
        self.lines += ["v %.6f %.6f %.6f" % p for p, _ in places]
        self.lines += ["vn %.4f %.4f %.4f" % n for _, n in places]
        self.lines += [
            f"vt {i / columns:.6f} {j / rows:.6f}" for j in range(rows + 1) for i in range(columns + 1)
        ]
        self.lines += ["usemtl Cotton", "s 1"]
        for j in range(rows):
            for i in range(columns):
                quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                corners = []
                for a, b in quad:
                    place = b * ring + a % ring + 1
                    texture = b * (columns + 1) + a + 1
                    corners.append(
                        f"{self.vertices + place}/{self.textures + texture}/{self.normals + place}"
                    )
                self.lines.append("f " + " ".join(corners))
        self.vertices += len(places)
        self.normals += len(places)
        self.textures += (rows + 1) * (columns + 1)


def curtain(s, t):
    """Half a cylinder, 0.3 m in radius and 0.9 m high, open to the back."""
    angle = pi * (0.5 - s)
    return (0.3 * cos(angle), -0.9 + 0.9 * t, -1.0 - 0.3 * sin(angle)), (cos(angle), 0.0, -sin(angle))


def tube(s, t):
    """A closed cylinder, 0.2 m in radius and 0.6 m high."""
    angle = -2 * pi * s
    return (0.2 * cos(angle), -0.6 + 0.6 * t, 0.2 * sin(angle)), (cos(angle), 0.0, sin(angle))


def towel(s, t):
    """Flat, 0.5 m by 0.7 m, tilted out of the vertical by 30 degrees."""
    return (0.35 * (1 - t), -0.7 * cos(pi / 6) * (1 - t), 1.0 - 0.5 * (s - 0.5)), (cos(pi / 6), sin(pi / 6), 0.0)


writer = Writer()
writer.grid("Curtain", 18, 16, curtain)
writer.grid("Tube", 24, 12, tube, closed=True)
writer.grid("Towel", 10, 14, towel)
print("\n".join(writer.lines))
