"""Writes the preset of the data set that `paper` learned from in its last stages: motions that jerk,
faster ones, handles that move apart, and 50 other meshes.

    python3 assets/datasets/broad.py out/broad-400
    selvedge data generate out/broad-400/broad-400.toml -o data/broad-400
    python3 assets/datasets/broad.py out/broad-400 --jumps data/broad-400

`--density 1024` is the paper's density, `--few` the quarter of the square's motions that `paper-1024` learned from.

The last command lists what surrounds each jump of a speed several times more among the sections to
learn from: such frames are one in a hundred otherwise.

The motions and meshes are drawn at random, the same ones every time. None is a test or a
generalisation motion, and none a mesh that has a name.
"""

import argparse
import json
import math
import pathlib
import random
import tomllib

#: Motions of the square that `--few` keeps.
FEW = {
    "random": range(32),
    "jerk": range(12),
    "reversal": range(12),
    "leap": [*range(8), *range(40, 56)],
    "own-apart": range(4),
}
CORNERS = '{ label = "upper-corners" }'


def unit(draw):
    z, a = draw.uniform(-1, 1), draw.uniform(0, 2 * math.pi)
    r = math.sqrt(1 - z * z)
    return [r * math.cos(a), z, r * math.sin(a)]


def scaled(v):
    n = math.sqrt(sum(x * x for x in v))
    return [x / n for x in v]


def pace(start, end, profile):
    return f'{{ start = {start:.5f}, end = {end:.5f}, profile = "{profile}" }}'


def translation(direction, pace, digits=5):
    x, y, z = (f"{c:.{digits}f}" for c in direction)
    return f"{{ direction = [{x}, {y}, {z}], pace = {pace} }}"


def rotation(center, sense, start, end):
    return f', rotation = {{ center = {center:.4f}, sense = "{sense}", arc = {pace(start, end, "smooth")} }}'


def blocks(moves, still):
    """Half a second still, the moves, `still` seconds still."""
    parts = ["{ duration = 0.5 }"]
    for duration, translations, turn in moves:
        of = f", translations = [{', '.join(translations)}]" if translations else ""
        parts.append(f"{{ duration = {duration:.10f}{of}{turn} }}")
    parts.append(f"{{ duration = {still} }}")
    return 'kind = "blocks"\nblocks = [\n    ' + ",\n    ".join(parts) + ",\n]\n"


def jerk(draw):
    """Speeds of up to 0.025 m/frame that change from one frame to the next."""

    def drawn_pace(least=-0.025, most=0.025):
        a = draw.uniform(least, most)
        b = draw.uniform(least, most) if draw.random() < 0.7 else a
        return pace(a, b, draw.choice(["linear", "smooth"]))

    moves = []
    for _ in range(draw.randint(5, 9)):
        duration, translations, turn = draw.randint(15, 75) / 60, [], ""
        kind = draw.random()
        if kind < 0.8:
            if draw.random() < 0.4:
                way = [round(draw.gauss(0, 0.15), 4), draw.choice([-1.0, 1.0]), round(draw.gauss(0, 0.15), 4)]
            else:
                way = [round(c, 5) for c in unit(draw)]
            translations.append(translation(scaled(way), drawn_pace(), 6))
        if kind < 0.4:
            translations.append(translation([round(c, 5) for c in unit(draw)], drawn_pace(-0.012, 0.012)))
        elif kind > 0.6:
            start, end = draw.uniform(0.004, 0.022), draw.uniform(0.004, 0.022)
            turn = rotation(draw.uniform(-2, 2), draw.choice(["clockwise", "counter-clockwise"]), start, end)
        moves.append((duration, translations, turn))
    return blocks(moves, 1.5)


def reversal(draw):
    """Moves that end in the opposite speed of their start, and begin anew at once."""
    if draw.random() < 0.5:
        base = unit(draw)
    else:
        base = [draw.gauss(0, 0.2), draw.choice([-1.0, 1.0]), draw.gauss(0, 0.2)]
    moves = []
    for _ in range(draw.randint(5, 9)):
        duration = draw.randint(20, 65) / 60
        way = base if draw.random() < 0.6 else unit(draw)
        way = scaled([c + draw.gauss(0, 0.1) for c in way])
        start = draw.choice([-1, 1]) * draw.uniform(0.008, 0.026)
        end = -start * draw.uniform(0.2, 1.1)
        main = translation(way, pace(start, end, draw.choice(["linear", "linear", "smooth"])), 6)
        translations, turn = [main], ""
        kind = draw.random()
        if kind < 0.4:
            way, start = unit(draw), draw.uniform(0.003, 0.014)
            end = start if draw.random() < 0.6 else draw.uniform(0.003, 0.014)
            translations.append(translation(way, pace(start, end, "smooth")))
        elif kind < 0.75:
            start = draw.uniform(0.005, 0.022)
            end = start if draw.random() < 0.6 else draw.uniform(0.005, 0.022)
            center = draw.uniform(-2.2, 2.2)
            turn = rotation(center, draw.choice(["clockwise", "counter-clockwise"]), start, end)
        moves.append((duration, translations, turn))
    return blocks(moves, 2.0)


def leap(draw):
    """Moves that turn round from their end to the next start, again and again."""
    if draw.random() < 0.6:
        base = [draw.gauss(0, 0.15), draw.choice([-1.0, 1.0]), draw.gauss(0, 0.15)]
    else:
        base = unit(draw)
    speed, part = draw.choice([-1, 1]) * draw.uniform(0.013, 0.025), draw.uniform(0.7, 1.1)
    moves = []
    for _ in range(draw.randint(4, 7)):
        way = scaled([c + draw.gauss(0, 0.1) for c in base])
        main = translation(way, pace(speed, -part * speed, draw.choice(["linear", "linear", "smooth"])), 6)
        translations, turn = [main], ""
        kind = draw.random()
        if kind < 0.4:
            start = draw.uniform(0.003, 0.014)
            way = unit(draw)
            end = start if draw.random() < 0.6 else draw.uniform(0.003, 0.014)
            translations.append(translation(way, pace(start, end, "smooth")))
        elif kind < 0.8:
            start = draw.uniform(0.005, 0.022)
            end = start if draw.random() < 0.6 else draw.uniform(0.005, 0.022)
            center = draw.uniform(-2.2, 2.2)
            turn = rotation(center, draw.choice(["clockwise", "counter-clockwise"]), start, end)
        moves.append((draw.randint(30, 70) / 60, translations, turn))
    return blocks(moves, 2.0)


def bounce(draw):
    """Leaps to and fro, half of them all alike."""
    base = [draw.gauss(0, 0.1), draw.choice([-1.0, 1.0]), draw.gauss(0, 0.1)] if draw.random() < 0.7 else unit(draw)
    speed, part = draw.choice([-1, 1]) * draw.uniform(0.014, 0.027), draw.uniform(0.7, 1.1)
    alike, length, turns = draw.random() < 0.5, draw.randint(40, 70), draw.random() < 0.5
    start, end = draw.uniform(0.005, 0.022), draw.uniform(0.005, 0.022)
    turn = rotation(draw.uniform(-2.2, 2.2), draw.choice(["clockwise", "counter-clockwise"]), start, end)
    moves = []
    for _ in range(draw.randint(5, 8)):
        way = scaled([c + draw.gauss(0, 0.0 if alike else 0.1) for c in base])
        main = translation(way, pace(speed, -part * speed, "linear"), 6)
        moves.append(((length if alike else draw.randint(30, 70)) / 60, [main], turn if turns else ""))
    return blocks(moves, 2.0)


def apart(draw):
    """Places of both handles in each frame, at distances from 0.55 to 1 m and heights of their own, as CSV."""
    frames, keys = 540, [30]
    while keys[-1] < frames - 120:
        keys.append(keys[-1] + draw.randint(30, 75))
    # Middle, yaw, tilt, distance.
    states = [(0, 0, 0, 0.0, 0.0, 1.0)]
    for _ in keys[1:]:
        x, y, z, yaw, _, _ = states[-1]
        x, y, z = x + draw.uniform(-0.5, 0.5), y + draw.uniform(-0.4, 0.4), z + draw.uniform(-0.5, 0.5)
        yaw += draw.uniform(-0.7, 0.7)
        states.append((x, y, z, yaw, draw.uniform(-0.4, 0.4), draw.uniform(0.55, 1.0)))
    rows = ["frame,handle,x,y,z"]
    for frame in range(frames + 1):
        k = 0
        while k + 1 < len(keys) and frame >= keys[k + 1]:
            k += 1
        if frame < keys[0] or k + 1 >= len(keys):
            state = states[0] if frame < keys[0] else states[-1]
        else:
            part = (1 - math.cos(math.pi * (frame - keys[k]) / (keys[k + 1] - keys[k]))) / 2
            state = [a + (b - a) * part for a, b in zip(states[k], states[k + 1])]
        x, y, z, yaw, tilt, distance = state
        for handle, side in ((0, -1), (1, 1)):
            half = side * distance / 2
            across, along = math.sin(yaw) * math.cos(tilt) * half, math.cos(yaw) * math.cos(tilt) * half
            rows.append(f"{frame},{handle},{x + across:.7f},{y + math.sin(tilt) * half:.7f},{z + along:.7f}")
    return "\n".join(rows) + "\n"


def generator(draw, kind, seed, square, density):
    """A rectangle, a square or a polygon, of so many vertices per square metre."""
    rectangles, squares = (0.55, 0.65) if square else (0.5, 0.5)
    if kind < rectangles:
        width, height = draw.uniform(0.5, 1.7), draw.uniform(0.5, 1.5)
        shape = f'kind = "rectangle", width = {width:.3f}, size = {height:.3f}'
    elif kind < squares:
        shape = f'kind = "square", size = {draw.uniform(0.5, 1.5):.3f}'
    else:
        shape = f'kind = "random", size = {draw.uniform(0.8, 1.4):.3f}'
    return f"{{ generator = {{ {shape}, density = {density}.0, seed = {seed} }} }}"


def main(folder, density, few):
    folder.mkdir(parents=True, exist_ok=True)
    own, cloths = {}, []
    train = ["all-training"] + [f"random-{k}" for k in range(80)]

    draw = random.Random(20261127)
    own.update({f"jerk-{k}": jerk(draw) for k in range(28)})
    train += [f"jerk-{k}" for k in range(28)]
    for k in range(10):
        (folder / f"apart-{k}.csv").write_text(apart(draw))
        own[f"own-apart-{k}"] = None
        train.append(f"own-apart-{k}")
    train += [f"random-{k}@1.5" for k in range(200, 206)] + [f"random-{k}@2" for k in range(206, 210)]
    for k in range(26):
        mesh = generator(draw, draw.random(), 50 + k, square=True, density=density)
        own[f"m{k}-jerk"] = jerk(draw)
        motions = [f"m{k}-jerk", f"random-{300 + 3 * k}", f"random-{301 + 3 * k}"]
        cloths.append((mesh, motions + [f"random-{302 + 3 * k}@1.5"] * (k % 3 == 0)))

    draw = random.Random(77)
    own.update({f"reversal-{k}": reversal(draw) for k in range(48)})
    train += [f"reversal-{k}" for k in range(48)]
    for k in range(26, 38):
        mesh = generator(draw, draw.random(), 150 + k, square=False, density=density)
        motions = [f"m{k}-reversal-{j}" for j in range(2)]
        own.update({name: reversal(draw) for name in motions})
        cloths.append((mesh, motions + [f"random-{500 + 2 * k}", f"random-{501 + 2 * k}@1.3"]))

    draw = random.Random(4041)
    own.update({f"leap-{k}": leap(draw) for k in range(40)})
    train += [f"leap-{k}" for k in range(40)]

    draw = random.Random(5115)
    own.update({f"leap-{k}": bounce(draw) for k in range(40, 76)})
    train += [f"leap-{k}" for k in range(40, 76)]
    for k in range(38, 50):
        mesh = generator(draw, draw.random(), 212 + k, square=True, density=density)
        motions = [f"m{k}-leap-{j}" for j in range(3)]
        own.update({name: bounce(draw) for name in motions})
        cloths.append((mesh, motions))

    if few:
        kept = {"all-training", "random-200@1.5", "random-201@1.5", "random-206@2"}
        for kind, numbers in FEW.items():
            kept |= {f"{kind}-{k}" for k in numbers}
        train, cloths = [name for name in train if name in kept], []
        own = {name: motion for name, motion in own.items() if name in kept}

    square = f'{{ generator = {{ kind = "square", vertices = {density}, size = 1.0, seed = 1 }} }}'
    text = f'name = "broad-{density}"\nsections = "whole"\ntrain = {json.dumps(train)}\ntest = "all-test"\n\n[setting]\n'
    text += f'material = "gray-interlock"\nmesh = {square}\nhandles = {CORNERS}\nphysics = {{ substeps = 8, solver = {{ conjugate-gradients = {{ tolerance = 1e-7 }} }} }}\n'
    for name, motion in own.items():
        recorded = f'[motions.{name}]\nrecorded = "{name.removeprefix("own-")}.csv"\n'
        text += "\n" + (recorded if motion is None else f"[motions.{name}.inline]\n{motion}")
    for k, (mesh, motions) in enumerate(cloths):
        text += f'\n[[cloths]]\nname = "m{k}"\nmesh = {mesh}\nhandles = {CORNERS}\ntrain = {json.dumps(motions)}\n'
    (folder / f"broad-{density}.toml").write_text(text)


def list_jumps(folder, data):
    """Adds the 29 frames about each jump to the sections of the data set, twice, or thrice where it leaps,
    and the 11 nearest twice more."""
    (preset,) = folder.glob("*.toml")
    motions = tomllib.loads(preset.read_text())["motions"]
    index = json.loads((data / "index.json").read_text())
    for number, entry in enumerate(index["splits"]["train"]):
        motion = motions.get(entry["motion"].split(".")[-1], {})
        frame = 0
        for block in motion.get("inline", {"blocks": []})["blocks"][:-1]:
            frame += round(60 * block["duration"])
            for before, after, times in ((7, 22, 3 if "leap" in entry["motion"] else 2), (3, 8, 2)):
                section = {"trajectory": number, "start": max(0, frame - before), "end": min(entry["frames"], frame + after)}
                index["sections"] += times * [section]
                index["statistics"]["samples"] += times * (section["end"] - section["start"] - 2)
    (data / "index.json").write_text(json.dumps(index))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="of the preset")
    parser.add_argument("--jumps", type=pathlib.Path, metavar="DATA", help="the folder of the data set")
    parser.add_argument("--density", type=int, default=400, help="vertices per square metre [400]")
    parser.add_argument("--few", action="store_true", help="a quarter of the square's motions, no other mesh")
    asked = parser.parse_args()
    if asked.jumps:
        list_jumps(asked.folder, asked.jumps)
    else:
        main(asked.folder, asked.density, asked.few)
