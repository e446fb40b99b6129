"""Motions and meshes that the model never saw: each beside the physics, with its error.

    pip install pillow
    python docs/src/python/generalisation.py selvedge -o out/generalisation      # 9 min

A run that diverges is repeated with the default guard, and marked. Writes `generalisation.png` and
prints the errors as a Markdown table.
"""

import argparse
import json
import subprocess
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

#: Kind, size [m] and handles of the meshes, 400 vertices per m²: those that the paper shows, and three more.
MESHES = {
    "square": ("square", 1.0, "upper-corners"),
    "long": ("long", 1.0, "upper-corners"),
    "wide": ("wide", 1.0, "upper-corners"),
    "big": ("square", 1.5, "upper-corners"),
    "quarter": ("square", 0.5, "upper-corners"),
    "triangle": ("triangle", 1.0, "upper-corners"),
    "diamond, 3 handles": ("diamond", 1.0, "upper-three"),
    "wide, 3 handles": ("wide", 1.0, "upper-three"),
    "triangle, 17 handles": ("triangle", 1.0, "upper-row"),
    "disc": ("disc", 1.0, "upper-corners"),
    "l-shape": ("l-shape", 1.0, "upper-corners"),
    "with a hole": ("holed", 1.0, "upper-corners"),
}
MOTIONS = ["bouncy", "rotate-bounce", "spiral", "snake", "upward-spiral", "apart"]
#: Top speeds [m/frame]; that of the training is 0.02617.
SPEEDS = ["0.015", "0.02", "0.02617", "0.03", "0.04", "0.05"]
CASES = (
    [("square", motion) for motion in MOTIONS]
    + [(mesh, "upward-spiral") for mesh in list(MESHES)[1:]]
    + [("square", f"speed-{speed}") for speed in SPEEDS]
)
WIDTH, COLUMNS = 170, 8


def run(program: str, model: str, scene: Path, guard: str, folder: Path) -> dict:
    """What `selvedge run` says of the model in this scene under this guard, beside the physics."""
    command = [program, "run", scene, "--model", model, "--compare", "--guard", guard]
    command += ["--no-clip", "--json", "-q", "-o", folder]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def scene(mesh: str, motion: str) -> str:
    """A scene file of the fabric and the physics that the model learned from."""
    kind, size, handles = MESHES[mesh]
    return f"""name = "{mesh} {motion}"
material = "gray-interlock"
mesh = {{ generator = {{ kind = "{kind}", density = 400.0, size = {size}, seed = 1 }} }}
handles = {{ label = "{handles}" }}
motion = {{ named = "{motion}" }}
physics = {{ substeps = 8, solver = {{ conjugate-gradients = {{ tolerance = 1e-7 }} }} }}
"""


def tile(program: str, folder: Path, frame: int, lines: list[str]) -> Image.Image:
    """The frame by the physics, over that by the model, under these lines."""
    whole = Image.new("RGB", (WIDTH, 2 * WIDTH + 44), "white")
    for k, of in enumerate(("truth", "rollout")):
        picture = folder / f"{of}.png"
        command = [program, "export", folder / f"{of}.safetensors", "-o", picture, "--frames", str(frame), "-q"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        moment = Image.open(picture).convert("RGB")
        side = min(moment.size)
        left, top = (moment.width - side) // 2, (moment.height - side) // 2
        moment = moment.crop((left, top, left + side, top + side)).resize((WIDTH, WIDTH), Image.LANCZOS)
        whole.paste(moment, (0, 44 + k * WIDTH))
    font = ImageFont.load_default(13)
    ImageDraw.Draw(whole).multiline_text((6, 4), "\n".join(lines), fill="black", font=font)
    return whole


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("program", help="the program, `selvedge`")
    parser.add_argument("--model", default="paper", help="a name or a file")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/generalisation"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    print("| mesh | motion | diverges in frame | position RMSE, mm | rest pose moved rigidly, mm |")
    print("|---|---|---|---:|---:|")
    tiles = []
    for mesh, motion in CASES:
        folder = options.output / f"{mesh} {motion}".replace(",", "").replace(" ", "-")
        folder.mkdir(exist_ok=True)
        file = folder / "scene.toml"
        file.write_text(scene(mesh, motion))
        answer = run(options.program, options.model, file, "none", folder)
        frame = answer["diverged_frame"]
        if frame is not None:
            answer = run(options.program, options.model, file, "limit", folder)
        error = 1e3 * answer["comparison"]["position_rmse"]
        guarded = "" if frame is None else ", guarded"
        print(f"| {mesh} | {motion} | {frame or '–'} | {error:.1f}{guarded} | {1e3 * answer['rigid_rmse']:.1f} |", flush=True)
        name = mesh if mesh != "square" else motion
        tiles.append(tile(options.program, folder, answer["frames"] // 2, [name, f"{error:.0f} mm{guarded}"]))
    height = tiles[0].height
    rows = -(-len(tiles) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * WIDTH, rows * height), "white")
    for k, each in enumerate(tiles):
        whole.paste(each, (k % COLUMNS * WIDTH, k // COLUMNS * height))
    whole.quantize(128).save(options.output / "generalisation.png", optimize=True)


if __name__ == "__main__":
    main()
