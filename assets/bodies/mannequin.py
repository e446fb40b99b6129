"""Writes mannequin.glb: a simple closed human form with a skeleton, and what it can do.

The form is a smooth union of capsules, cut into triangles by surface nets, evened out on the
surface, and bound to thirteen joints. It stands on the ground y = 0 and looks along +z; its left is
+x. The animations `stand`, `turn`, `walk` (on the spot) and `raise-arms` all begin and end in the
same stance, at rest; `hold-arms-out` stays with the arms at the height of the shoulders; `wear`
begins so, and then turns and raises its arms. Needs nothing but Python 3:

    python3 mannequin.py > mannequin.glb
    python3 mannequin.py 0.02 > finer.glb        # length of an edge, metres; 0.03 unless given
"""

import json
import struct
import sys
from math import ceil, cos, pi, radians, sin, sqrt

EDGE = float(sys.argv[1]) if len(sys.argv) > 1 else 0.03
BLEND = 0.035  # distance over which parts go over into each other, metres
RATE = 60  # keys per second
BIND_ARMS, STAND_ARMS, HIGH_ARMS = 45.0, 22.0, 120.0  # degrees from straight down


# Vectors are tuples.
def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def mul(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a):
    return sqrt(dot(a, a))


# ------------------------------------------------------------------------------------- skeleton

def mirrored(a):
    return (-a[0], a[1], a[2])


ARM = (sin(radians(BIND_ARMS)), -cos(radians(BIND_ARMS)), 0.0)
SHOULDER = (0.185, 1.385, 0.0)
ELBOW = add(SHOULDER, mul(ARM, 0.27))
WRIST = add(ELBOW, mul(ARM, 0.24))
FINGERS = add(WRIST, mul(ARM, 0.13))
HIP, KNEE, ANKLE = (0.095, 0.90, 0.0), (0.112, 0.49, 0.005), (0.128, 0.085, -0.01)

# name: (parent, place). Left first; the right side is its mirror image.
JOINTS = {"pelvis": (None, (0.0, 0.94, 0.0)), "chest": ("pelvis", (0.0, 1.12, 0.0)),
          "head": ("chest", (0.0, 1.45, 0.0))}
# (joint, end, end, radius, radius)
PARTS = [
    ("pelvis", (-0.07, 0.93, 0.0), (0.07, 0.93, 0.0), 0.105, 0.105),
    ("pelvis", (-0.055, 1.04, 0.0), (0.055, 1.04, 0.0), 0.092, 0.092),
    ("chest", (-0.055, 1.14, 0.0), (0.055, 1.14, 0.0), 0.092, 0.092),
    ("chest", (-0.07, 1.26, 0.0), (0.07, 1.26, 0.0), 0.102, 0.102),
    ("chest", (-0.13, 1.375, 0.0), (0.13, 1.375, 0.0), 0.06, 0.06),
    ("chest", (0.0, 1.38, -0.005), (0.0, 1.46, 0.0), 0.06, 0.05),
    ("head", (0.0, 1.47, 0.005), (0.0, 1.53, 0.015), 0.05, 0.055),
    ("head", (0.0, 1.58, 0.02), (0.0, 1.64, 0.0), 0.075, 0.088),
]
for side, of in (("left", lambda a: a), ("right", mirrored)):
    arm, hand = f"{side} upper arm", f"{side} forearm"
    thigh, shin, foot = f"{side} thigh", f"{side} shin", f"{side} foot"
    JOINTS[arm] = ("chest", of(SHOULDER))
    JOINTS[hand] = (arm, of(ELBOW))
    JOINTS[thigh] = ("pelvis", of(HIP))
    JOINTS[shin] = (thigh, of(KNEE))
    JOINTS[foot] = (shin, of(ANKLE))
    PARTS += [
        (arm, of(SHOULDER), of(ELBOW), 0.055, 0.042),
        (hand, of(ELBOW), of(WRIST), 0.042, 0.031),
        (hand, of(WRIST), of(FINGERS), 0.031, 0.034),
        (thigh, of(HIP), of(KNEE), 0.092, 0.058),
        (shin, of(KNEE), of(ANKLE), 0.058, 0.040),
        (foot, of(add(ANKLE, (0.0, -0.042, -0.02))), of(add(ANKLE, (0.008, -0.047, 0.15))), 0.043, 0.037),
    ]
NAMES = list(JOINTS)
PLACES = [JOINTS[name][1] for name in NAMES]
PARENTS = [None if JOINTS[name][0] is None else NAMES.index(JOINTS[name][0]) for name in NAMES]


# ------------------------------------------------------------------------------------- surface

def part_distance(part, p):
    _, a, b, ra, rb = part
    ab, ap = sub(b, a), sub(p, a)
    t = min(1.0, max(0.0, dot(ap, ab) / dot(ab, ab)))
    return norm(sub(ap, mul(ab, t))) - (ra + (rb - ra) * t)


def distance(p):
    """Smooth union of the parts: below zero within."""
    total = 1e9
    for part in PARTS:
        d = part_distance(part, p)
        h = max(BLEND - abs(total - d), 0.0) / BLEND
        total = min(total, d) - h * h * BLEND * 0.25
    return total


def slope(p, step=1e-4):
    axes = ((step, 0.0, 0.0), (0.0, step, 0.0), (0.0, 0.0, step))
    g = tuple((distance(add(p, e)) - distance(sub(p, e))) / (2 * step) for e in axes)
    return g


def on_surface(p):
    for _ in range(3):
        g = slope(p)
        p = sub(p, mul(g, distance(p) / max(dot(g, g), 1e-9)))
    return p


def surface_net(edge):
    """Quads around every grid edge that crosses the surface; a vertex in every cell that does."""
    low, high = (-0.72, -0.04, -0.16), (0.72, 1.80, 0.24)
    counts = [ceil((high[k] - low[k]) / edge) + 1 for k in range(3)]
    counts[0] += counts[0] % 2  # x = 0 is the middle of a cell: the sides are alike
    origin = (-0.5 * (counts[0] - 1) * edge, low[1], low[2])
    place = lambda c: tuple(origin[k] + c[k] * edge for k in range(3))
    grid = {(i, j, k): distance(place((i, j, k)))
            for i in range(counts[0]) for j in range(counts[1]) for k in range(counts[2])}
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    edges = [(a, b) for a in corners for b in corners
             if sum(abs(x - y) for x, y in zip(a, b)) == 1 and a < b]
    number, points = {}, []
    for cell in ((i, j, k) for i in range(counts[0] - 1) for j in range(counts[1] - 1)
                 for k in range(counts[2] - 1)):
        value = {c: grid[add(cell, c)] for c in corners}
        crossed = [(a, b) for a, b in edges if (value[a] < 0) != (value[b] < 0)]
        if not crossed:
            continue
        sum_of = (0.0, 0.0, 0.0)
        for a, b in crossed:
            t = value[a] / (value[a] - value[b])
            sum_of = add(sum_of, add(mul(a, 1 - t), mul(b, t)))
        number[cell] = len(points)
        points.append(place(add(cell, mul(sum_of, 1 / len(crossed)))))
    quads = []
    axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    for corner, value in grid.items():
        for k, axis in enumerate(axes):
            other = grid.get(add(corner, axis))
            if other is None or (value < 0) == (other < 0):
                continue
            u, v = axes[(k + 1) % 3], axes[(k + 2) % 3]
            cells = [sub(sub(corner, u), v), sub(corner, v), corner, sub(corner, u)]
            quad = [number[cell] for cell in cells]
            quads.append(quad if value < 0 else quad[::-1])
    return points, quads


def split(points, quads):
    faces = []
    for a, b, c, d in quads:
        if norm(sub(points[a], points[c])) <= norm(sub(points[b], points[d])):
            faces += [(a, b, c), (a, c, d)]
        else:
            faces += [(a, b, d), (b, c, d)]
    return faces


def neighbours(count, faces):
    around = [set() for _ in range(count)]
    for face in faces:
        for k in range(3):
            around[face[k]].update((face[k - 1], face[k - 2]))
    return [sorted(near) for near in around]


def evened(points, quads, rounds=12):
    """Vertices move to the middle of their neighbours, and back onto the surface."""
    around = [set() for _ in points]
    for quad in quads:
        for k in range(4):
            around[quad[k]].update((quad[k - 1], quad[(k + 1) % 4]))
    around = [sorted(near) for near in around]
    points = [on_surface(p) for p in points]
    for _ in range(rounds):
        moved = []
        for p, near in zip(points, around):
            middle = mul(tuple(map(sum, zip(*(points[q] for q in near)))), 1 / len(near))
            moved.append(add(mul(p, 0.5), mul(middle, 0.5)))
        points = [on_surface(p) for p in moved]
    return points


def weights(points, faces, rounds=7):
    """Each vertex belongs to the joint of the nearest part; then shares go along the surface, so
    that an arm takes nothing of the body beside it."""
    around = neighbours(len(points), faces)
    owner = [NAMES.index(min(PARTS, key=lambda part: part_distance(part, p))[0]) for p in points]
    shares = [{joint: 1.0} for joint in owner]
    for _ in range(rounds):
        mixed = []
        for own, near in zip(shares, around):
            total = {joint: 0.5 * share for joint, share in own.items()}
            for q in near:
                for joint, share in shares[q].items():
                    total[joint] = total.get(joint, 0.0) + 0.5 * share / len(near)
            mixed.append(total)
        shares = mixed
    bound = []
    for own in shares:
        best = sorted(own.items(), key=lambda entry: (-entry[1], entry[0]))[:4]
        best += [(0, 0.0)] * (4 - len(best))
        whole = sum(share for _, share in best)
        # Shares of 255, with their sum.
        parts = [int(255 * share / whole) for _, share in best]
        parts[0] += 255 - sum(parts)
        bound.append(([joint for joint, _ in best], parts))
    return bound


# ------------------------------------------------------------------------------------- motion

def turn(axis, degrees):
    half = radians(degrees) / 2
    return (axis[0] * sin(half), axis[1] * sin(half), axis[2] * sin(half), cos(half))


def quat_mul(a, b):
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def turned(q, p):
    u, w = q[:3], q[3]
    c = (u[1] * p[2] - u[2] * p[1], u[2] * p[0] - u[0] * p[2], u[0] * p[1] - u[1] * p[0])
    c = add(c, mul(p, w))
    d = (u[1] * c[2] - u[2] * c[1], u[2] * c[0] - u[0] * c[2], u[0] * c[1] - u[1] * c[0])
    return add(p, mul(d, 2))


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def eased(t):
    """From 0 to 1 with speed and acceleration zero at both ends."""
    t = min(1.0, max(0.0, t))
    return t * t * t * (t * (6 * t - 15) + 10)


def stance(arms=STAND_ARMS, forward=(0.0, 0.0)):
    """Arms at so many degrees from straight down, swung forward by so many."""
    pose = {}
    for sign, side, swing in ((1, "left", forward[0]), (-1, "right", forward[1])):
        pose[f"{side} upper arm"] = quat_mul(turn(X, -swing), turn(Z, sign * (arms - BIND_ARMS)))
    return pose


def stand(t):
    return stance()


def spin(t):
    pose = stance()
    pose["pelvis"] = turn(Y, 360 * eased(t / 4.0))
    return pose


def raise_arms(t):
    up = eased((t - 0.25) / 2.0) - eased((t - 3.0) / 2.0)
    return stance(STAND_ARMS + (HIGH_ARMS - STAND_ARMS) * up)


def hold_arms_out(t):
    return stance(90.0)


def wear(t):
    """Arms out, as one stands to be dressed; then down, and once about itself, arms raised and let
    down again on the way."""
    down = eased((t - 0.3) / 0.9)
    up = eased((t - 1.4) / 1.4) - eased((t - 3.2) / 1.4)
    pose = stance(90.0 + (STAND_ARMS - 90.0) * down + (HIGH_ARMS - STAND_ARMS) * up)
    pose["pelvis"] = turn(Y, 360 * eased((t - 1.2) / 3.4))
    return pose


def walk(t):
    """Steps on the spot, one in half a second; they grow and fade over a second each."""
    much = eased(t) * (1 - eased(t - 4.0))
    phase = 2 * pi * t
    pose = stance(STAND_ARMS, (-18 * much * sin(phase), 18 * much * sin(phase)))
    for side, shift in (("left", 0.0), ("right", pi)):
        hip = 22 * sin(phase + shift) + 6
        knee = 28 * (1 + cos(phase + shift)) * 0.75 + 4
        pose[f"{side} thigh"] = turn(X, -much * hip)
        pose[f"{side} shin"] = turn(X, much * knee)
        pose[f"{side} foot"] = turn(X, much * (hip - knee) * 0.8)
    pose["chest"] = turn(Y, 5 * much * sin(phase))
    return pose


MOTIONS = {"stand": (stand, 5.0), "turn": (spin, 5.0), "walk": (walk, 5.0),
           "raise-arms": (raise_arms, 5.25), "hold-arms-out": (hold_arms_out, 5.0), "wear": (wear, 5.0)}


def frames(pose, lift):
    """Turn and place of every joint in the world."""
    made = []
    for number, name in enumerate(NAMES):
        own = pose.get(name, (0.0, 0.0, 0.0, 1.0))
        parent = PARENTS[number]
        if parent is None:
            made.append((own, add(PLACES[number], (0.0, lift, 0.0))))
        else:
            q, p = made[parent]
            offset = sub(PLACES[number], PLACES[parent])
            made.append((quat_mul(q, own), add(p, turned(q, offset))))
    return made


def lowest(points, bound, pose):
    """Height of the lowest vertex in a pose."""
    places = frames(pose, 0.0)
    least = 1e9
    for p, (joints, parts) in zip(points, bound):
        if p[1] > 0.3:
            continue
        y = 0.0
        for joint, part in zip(joints, parts):
            if part:
                q, at = places[joint]
                y += part / 255 * (turned(q, sub(p, PLACES[joint]))[1] + at[1])
        least = min(least, y)
    return least


# ------------------------------------------------------------------------------------- glTF

class Glb:
    """A .glb under way: accessors over one buffer."""

    def __init__(self):
        self.binary, self.views, self.accessors = b"", [], []

    def store(self, kind, component, rows, bounds=False, normalized=False):
        letter = {5121: "B", 5123: "H", 5126: "f"}[component]
        flat = [x for row in rows for x in (row if isinstance(row, (tuple, list)) else (row,))]
        data = struct.pack(f"<{len(flat)}{letter}", *flat)
        self.views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data + b"\0" * (-len(data) % 4)
        accessor = {"bufferView": len(self.views) - 1, "componentType": component,
                    "count": len(rows), "type": kind}
        if normalized:
            accessor["normalized"] = True
        if bounds:
            rows = [row if isinstance(row, (tuple, list)) else (row,) for row in rows]
            single = lambda x: struct.unpack("<f", struct.pack("<f", x))[0]
            accessor["min"] = [single(min(column)) for column in zip(*rows)]
            accessor["max"] = [single(max(column)) for column in zip(*rows)]
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def bytes(self, document):
        document["buffers"] = [{"byteLength": len(self.binary)}]
        document["bufferViews"], document["accessors"] = self.views, self.accessors
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        body += struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def animations(glb, points, bound):
    made = []
    for name, (motion, seconds) in MOTIONS.items():
        still = motion in (stand, hold_arms_out)
        count = 2 if still else round(seconds * RATE) + 1
        times = [seconds * k / (count - 1) for k in range(count)]
        poses = [motion(t) for t in times]
        drops = [-lowest(points, bound, pose) for pose in poses]
        clock = glb.store("SCALAR", 5126, times, bounds=True)
        samplers, channels = [], []

        def channel(joint, path, kind, rows):
            if all(row == rows[0] for row in rows) and not still:
                rows, at = [rows[0]] * 2, short()
            else:
                at = clock
            samplers.append({"input": at, "output": glb.store(kind, 5126, rows),
                             "interpolation": "LINEAR"})
            channels.append({"sampler": len(samplers) - 1,
                             "target": {"node": joint, "path": path}})

        ends = []

        def short():
            if not ends:
                ends.append(glb.store("SCALAR", 5126, [0.0, seconds], bounds=True))
            return ends[0]

        root = PLACES[0]
        channel(0, "translation", "VEC3", [(root[0], root[1] + y, root[2]) for y in drops])
        for joint, of in enumerate(NAMES):
            if any(of in pose for pose in poses):
                channel(joint, "rotation", "VEC4", [pose[of] for pose in poses])
        made.append({"name": name, "samplers": samplers, "channels": channels})
    return made


def nodes(lift):
    made = []
    pose = stance()
    for number, name in enumerate(NAMES):
        parent = PARENTS[number]
        offset = PLACES[number] if parent is None else sub(PLACES[number], PLACES[parent])
        if parent is None:
            offset = add(offset, (0.0, lift, 0.0))
        node = {"name": name, "translation": offset}
        if name in pose:
            node["rotation"] = pose[name]
        children = [k for k, of in enumerate(PARENTS) if of == number]
        if children:
            node["children"] = children
        made.append(node)
    made.append({"name": "mannequin", "mesh": 0, "skin": 0})
    return made


def main():
    points, quads = surface_net(EDGE)
    points = evened(points, quads)
    faces = split(points, quads)
    # Positions as the file has them, for the heights of the feet.
    single = lambda p: struct.unpack("<3f", struct.pack("<3f", *p))
    points = [single(p) for p in points]
    bound = weights(points, faces)
    glb = Glb()
    attributes = {
        "POSITION": glb.store("VEC3", 5126, points, bounds=True),
        "JOINTS_0": glb.store("VEC4", 5121, [joints for joints, _ in bound]),
        "WEIGHTS_0": glb.store("VEC4", 5121, [parts for _, parts in bound], normalized=True),
    }
    indices = glb.store("SCALAR", 5123, [v for face in faces for v in face])
    inverse = [(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -p[0], -p[1], -p[2], 1) for p in PLACES]
    binds = glb.store("MAT4", 5126, inverse)
    document = {
        "asset": {"version": "2.0", "generator": "mannequin.py (Selvedge)"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(NAMES)]}],
        "nodes": nodes(-lowest(points, bound, stance())),
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "skins": [{"joints": list(range(len(NAMES))), "inverseBindMatrices": binds}],
        "animations": animations(glb, points, bound),
    }
    sys.stdout.buffer.write(glb.bytes(document))
    print(f"{len(points)} vertices, {len(faces)} faces", file=sys.stderr)


main()
