"""Writes the preset of the data set for `any`: cloths of 100 to 1600 vertices per square metre, of
mixtures of four fabrics, in wind of up to 10 m/s with gusts, on 1 to 17 handles that move
together or apart, are let go and take hold again; and cloths that meet bodies and themselves.

    python3 assets/datasets/any.py out/any
    selvedge data generate out/any/any.toml -o data/any
    python3 assets/datasets/broad.py out/any --jumps data/any

`--cloths 40` makes so many cloths instead of 240, `--bodies 10` so many with bodies instead of 120. Everything is drawn at random, the same each time. No
motion is a test or a generalisation motion, no mesh one that has a name but the square of the tests.
"""

import argparse
import math
import pathlib
import random
import tomllib

import broad

MATERIALS = pathlib.Path(__file__).parent.parent / "materials"
#: The other shipped fabrics are kept for tests.
FABRICS = ["11oz-black-denim", "camel-ponte-roma", "gray-interlock", "navy-sparkle-sweat"]
# A leap may strain a soft fabric by more than 1.5, the default, which would end the generation.
PHYSICS = "{ substeps = 8, max_strain = 4.0, solver = { conjugate-gradients = { tolerance = 1e-7 } } }"
#: Vertices of a cloth: a sample costs as much as it has.
FEWEST, MOST = 90, 900
#: Cloths with any bodies; those after them have a floor.
ANY_BODIES = 80


def fabric(draw, known):
    """A shipped fabric by its name, or a mixture of two as a table, up to a third heavier or stiffer."""
    if draw.random() < 0.4:
        return f'"{draw.choice(sorted(known))}"'
    first, second = (known[name] for name in draw.sample(sorted(known), 2))
    part = draw.random()

    def mixed(key):
        rows = zip(first[key], second[key])
        return [[round(part * a + (1 - part) * b, 10) for a, b in zip(*row)] for row in rows]

    density = (part * first["density"] + (1 - part) * second["density"]) * draw.uniform(0.75, 1.33)
    return (
        f'{{ name = "mixture", density = {density:.4f}, stretch = {mixed("stretch")}, bend = {mixed("bend")}, '
        f"stretch_multiplier = {draw.uniform(0.75, 1.33):.3f}, bend_multiplier = {draw.uniform(0.6, 1.6):.3f} }}"
    )


def weather(draw):
    """Still air for half of all cloths; else wind, mostly level, two thirds of it in gusts."""
    if draw.random() < 0.5:
        return None
    speed, way = 10 * draw.random() ** 1.5, draw.uniform(0, 2 * math.pi)
    wind = [speed * math.cos(way), speed * draw.uniform(-0.2, 0.2), speed * math.sin(way)]
    text = f"{{ wind = [{', '.join(f'{w:.2f}' for w in wind)}]"
    if draw.random() < 0.67:
        gust = [abs(draw.gauss(0, 0.3)) * speed for _ in range(3)]
        speeds = ", ".join(f"{g:.2f}" for g in gust)
        text += f", gust = {{ speed = [{speeds}], period = {draw.uniform(1, 4):.2f}, seed = {draw.randrange(10**6)} }}"
    return text + " }"


def rectangle(draw, number):
    """A rectangle, and its boundary vertices: how many segments its upper and its right side have."""
    density = 100 * 16 ** draw.random()
    least, most = FEWEST / density, MOST / density
    area = min(most, max(least, draw.uniform(0.25, 1.6)))
    shape = draw.uniform(0.7, 1.4)
    width, height = round(math.sqrt(area) * shape, 3), round(math.sqrt(area) / shape, 3)
    count = round(density * width * height)
    # As selvedge spaces the vertices of a boundary (crates/selvedge-cloth/src/generate/boundary.rs).
    half = width + height
    spacing = (half + math.sqrt(half * half + 4 * 1.07 * width * height * count)) / (2 * count)
    sides = [max(1, round(side / spacing)) for side in (width, height)]
    mesh = (
        f'{{ generator = {{ kind = "rectangle", width = {width}, size = {height}, '
        f"vertices = {count}, seed = {1000 + number} }} }}"
    )
    return mesh, sides, (width, height)


def held(draw, sides, size):
    """Numbers of the held vertices, and where they are [m]: along the upper edge, or all four corners."""
    (across, down), (width, height) = sides, size
    if draw.random() < 0.15:
        half = width / 2
        places = [(0, 0, -half), (0, 0, half), (0, -height, half), (0, -height, -half)]
        return [0, across, across + down, 2 * across + down], places
    count = min(draw.choice([1, 2, 2, 2, 2, 3, 5, 9, 17]), across + 1)
    if count == 1:
        numbers = [draw.choice([0, across // 2, across])]
    else:
        numbers = sorted({round(k * across / (count - 1)) for k in range(count)})
    return numbers, [(0, 0, width * (number / across - 0.5)) for number in numbers]


def released(draw, numbers, again=0.4):
    """Each handle a group of its own or not; one or two of them let go, and may take hold again."""
    if len(numbers) < 2 or draw.random() < 0.75:
        return f"{{ vertices = {numbers} }}"
    free = draw.sample(range(len(numbers)), draw.choice([1, 1, 2]) if len(numbers) > 2 else 1)
    groups = []
    for handle, number in enumerate(numbers):
        spans = ""
        if handle in free:
            start = draw.randint(60, 200) / 60
            end = f", to = {start + draw.randint(20, 90) / 60:.10f}" if draw.random() < again else ""
            spans = f", released = [{{ from = {start:.10f}{end} }}]"
        groups.append(f'{{ name = "h{handle}", select = {{ vertices = [{number}] }}{spans} }}')
    return f"{{ groups = [{', '.join(groups)}] }}"


def bodies(draw, size, floor):
    """One or two bodies beside a cloth that hangs in the plane x = 0 from y = 0, or surely or by chance a floor below
    it: none reaches up to where the handles go. Also the lowest that these go [m]."""
    width, height = size
    parts, lowest = [], -0.1
    if floor or draw.random() < 0.3:
        parts.append(f'{{ name = "floor", plane = {{ height = {-1.25 * height - 0.05:.3f} }} }}')
        lowest = -0.7 * height
    for number in range(draw.choice([0, 1]) if parts else draw.choice([1, 1, 2])):
        side = 1 if (number == 0) == (draw.random() < 0.8) else -1
        radius = draw.uniform(0.06, 0.22)
        top = min(draw.uniform(0.2, 0.7) * height, height - 0.05)
        away = side * (radius + draw.uniform(0.15, 0.45) + 0.3 * number)
        place = [away, -max(top, 0.18) - radius + min(lowest + 0.1, 0), draw.uniform(-0.35, 0.35) * width]
        kind = draw.choice(["sphere", "sphere", "capsule", "box"])
        shape = {
            "sphere": f"sphere = {{ radius = {radius:.3f} }}",
            "capsule": f"capsule = {{ radius = {0.6 * radius:.3f}, length = {draw.uniform(0.2, 0.9):.3f} }}",
            "box": f"box = {{ size = [{', '.join(f'{radius * draw.uniform(0.8, 1.4):.3f}' for _ in range(3))}] }}",
        }[kind]
        turn = f'rotation = {{ axis = [1, 0, 0], angle_deg = 90 }}, ' if kind == "capsule" else ""
        motion = ""
        if number == 0 and draw.random() < 0.5:
            begin, ways = draw.uniform(0.3, 1.0), [0.0, 0.0, 0.0]
            keys = [f"{{ time = {begin:.3f} }}"]
            for _ in range(3):
                begin += draw.uniform(0.5, 1.6)
                ways = [draw.uniform(-1.2, 0.2) * side, draw.uniform(-0.1, 0.05), draw.uniform(-0.3, 0.3)]
                keys.append(f"{{ time = {begin:.3f}, translation = [{', '.join(f'{w:.3f}' for w in ways)}] }}")
            motion = f", motion = {{ keyframes = [{', '.join(keys)}] }}"
        at = ", ".join(f"{p:.3f}" for p in place)
        parts.append(f'{{ name = "body-{number}", {shape}, transform = {{ {turn}translation = [{at}] }}{motion} }}')
    return f"[{', '.join(parts)}]", lowest


def own_ways(draw, places, lowest=None):
    """Places of all handles in each frame as CSV: they move together, and beside that inwards, up to four each
    on its own, which brings none farther from another than it was; no lower than `lowest`."""
    frames, keys = 300, [30]
    while keys[-1] < frames - 60:
        keys.append(keys[-1] + draw.randint(25, 70))
    middle = [sum(p[k] for p in places) / len(places) for k in range(3)]
    states = [((0, 0, 0), 0.0, [1.0] * len(places))]
    for _ in keys[1:]:
        (x, y, z), yaw, _ = states[-1]
        moved = (x + draw.uniform(-0.5, 0.5), y + draw.uniform(-0.4, 0.4), z + draw.uniform(-0.5, 0.5))
        if lowest is not None:
            moved = (moved[0], max(lowest, min(moved[1], 0.3)), moved[2])
        own = [draw.uniform(0.5, 1.0) for _ in places]
        states.append((moved, yaw + draw.uniform(-0.7, 0.7), own if len(places) <= 4 else own[:1] * len(places)))
    rows = ["frame,handle,x,y,z"]
    for frame in range(frames + 1):
        k = max([k for k, key in enumerate(keys) if frame >= key], default=0)
        last = k + 1 >= len(keys)
        span = 1 if last else keys[k + 1] - keys[k]
        part = 0.0 if frame < keys[0] or last else (1 - math.cos(math.pi * (frame - keys[k]) / span)) / 2
        here, there = states[k], states[k if last else k + 1]
        base = [a + (b - a) * part for a, b in zip(here[0], there[0])]
        yaw = here[1] + (there[1] - here[1]) * part
        for handle, place in enumerate(places):
            inward = here[2][handle] + (there[2][handle] - here[2][handle]) * part
            # From the place towards the middle of all: two points that both move inwards come closer.
            x, y, z = (m + (p - m) * inward for p, m in zip(place, middle))
            c, s = math.cos(yaw), math.sin(yaw)
            rows.append(f"{frame},{handle},{base[0] + c * x + s * z:.7f},{base[1] + y:.7f},{base[2] - s * x + c * z:.7f}")
    return "\n".join(rows) + "\n"


def main(folder, cloths, first, with_bodies):
    folder.mkdir(parents=True, exist_ok=True)
    known = {name: tomllib.loads((MATERIALS / f"{name}.toml").read_text()) for name in FABRICS}
    draw = random.Random(20261128)
    text = 'name = "any"\nsections = "whole"\ntrain = []\ntest = "all-test"\n\n[setting]\nmaterial = "gray-interlock"\n'
    text += 'mesh = { generator = { kind = "square", vertices = 400, size = 1.0, seed = 1 } }\n'
    text += f"handles = {broad.CORNERS}\nphysics = {PHYSICS}\n"
    motions, parts = "", ""
    for number in range(cloths):
        mesh, sides, size = rectangle(draw, number)
        numbers, places = held(draw, sides, size)
        material, air, handles = fabric(draw, known), weather(draw), released(draw, numbers)
        ways = []
        kinds = [broad.jerk, broad.reversal, broad.leap, broad.bounce]
        for way in range(2):
            name, kind = f"c{number}-{way}", draw.random()
            # A turn about the handles' line needs two of them.
            if len(numbers) == 1 or kind < 0.3:
                (folder / f"{name}.csv").write_text(own_ways(draw, places))
                motions += f'\n[motions.{name}]\nrecorded = "{name}.csv"\n'
            elif kind < 0.65:
                name = f"random-{1000 + 2 * number + way}"
            else:
                leaps = name.replace("c", "leap-c") if kind > 0.85 else name
                of = draw.choice(kinds[2:] if kind > 0.85 else kinds[:2])
                name = leaps
                motions += f"\n[motions.{name}.inline]\n{of(draw)}"
            ways.append(name)
        named = ", ".join(f'"{way}"' for way in ways)
        parts += f'\n[[cloths]]\nname = "k{number}"\nmesh = {mesh}\nhandles = {handles}\nmaterial = {material}\n'
        parts += f"train = [{named}]\n" + (f"environment = {air}\n" if air else "")
    for number in range(first, with_bodies):
        draw = random.Random(5000 + number)
        mesh, sides, size = rectangle(draw, cloths + number)
        # No corner is held below, where bodies are, and never one alone: cloth that hangs from a point lies in itself.
        numbers, places = held(draw, sides, size)
        while len(numbers) == 1 or places[-1][1] < 0:
            numbers, places = held(draw, sides, size)
        # What lies on a floor is not caught up from there at once.
        material, air, handles = fabric(draw, known), weather(draw), released(draw, numbers, again=0)
        obstacles, lowest = bodies(draw, size, number >= ANY_BODIES)
        named = []
        for way in range(2):
            name = f"b{number}-{way}"
            (folder / f"{name}.csv").write_text(own_ways(draw, places, lowest))
            motions += f'\n[motions.{name}]\nrecorded = "{name}.csv"\n'
            named.append(f'"{name}"')
        parts += f'\n[[cloths]]\nname = "o{number}"\nmesh = {mesh}\nhandles = {handles}\nmaterial = {material}\n'
        parts += f"obstacles = {obstacles}\ntrain = [{', '.join(named)}]\n" + (f"environment = {air}\n" if air else "")
    (folder / "any.toml").write_text(text + motions + parts)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="of the preset")
    parser.add_argument("--cloths", type=int, default=240, help="how many [240]")
    parser.add_argument("--bodies", type=int, default=120, help="how many more, with bodies, from the 81st on with a floor [120]")
    parser.add_argument("--first", type=int, default=0, help="leave out so many of these [0]")
    asked = parser.parse_args()
    main(asked.folder, asked.cloths, asked.first, asked.bodies)
