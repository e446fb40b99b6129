"""Tries the add-on without a window: a cloth between two empties, one of which moves.

    python blender/test_addon.py target/debug/selvedge

Needs bpy from PyPI. Exits with 1 where the cache that was loaded is not the run: every vertex of every frame is
compared with the trajectory, and the held ones with the empties.
"""

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "docs/src/python")]

import selvedge_cloth  # noqa: E402
from check_exports import blender_positions, read_trajectory, y_up  # noqa: E402

LAST = 12


def scene(program, folder):
    """A tilted grid between two empties, and the settings of the add-on."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    selvedge_cloth.register()
    made = bpy.context.scene
    made.render.fps, made.frame_start, made.frame_end = 24, 1, LAST + 1
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=1, location=(0.2, 0.1, 1), rotation=(0.3, 0, 0.5))
    grid = bpy.context.object
    bpy.context.view_layer.update()
    corners = [grid.matrix_world @ grid.data.vertices[v].co for v in (72, 80)]
    hands = []
    for number, corner in enumerate(corners):
        bpy.ops.object.empty_add(location=corner)
        hand = bpy.context.object
        hand.name, hand.empty_display_size = f"hand {number}", 0.05
        hands.append(hand)
    hands[1].keyframe_insert("location", frame=1)
    hands[1].location.z += 0.1
    hands[1].keyframe_insert("location", frame=LAST + 1)
    grid.select_set(False)
    for hand in hands:
        hand.select_set(True)
    settings = made.selvedge
    settings.mesh, settings.program, settings.folder = grid, program, str(folder)
    return hands


def main():
    program = str(Path(sys.argv[1]).resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        hands = scene(program, folder)
        ended = bpy.ops.selvedge.run()
        if ended != {"FINISHED"}:
            sys.exit(f"{ended}: {(folder / 'log.txt').read_text()}")
        arrays, rate = read_trajectory(folder / "run.safetensors")
        cloth = next(item for item in bpy.data.objects if item.name.endswith("cloth"))
        worst, off = 0.0, 0.0
        for frame, expected in enumerate(arrays["positions"]):
            found = blender_positions(bpy, cloth, 1 + frame)
            worst = max(worst, float(np.abs(found - expected).max()))
            for hand, vertex in zip(hands, (72, 80)):
                place = y_up(np.asarray(hand.matrix_world.translation))
                off = max(off, float(np.abs(found[vertex] - place).max()))
        print(f"{len(arrays['positions'])} frames at {rate} per second, cache {worst:.1e} m off, held vertices {off:.1e} m")
        moved = float(np.abs(arrays["positions"][-1] - arrays["positions"][0]).max())
        hands[0].select_set(False)
        hands[1].select_set(False)
        try:
            bpy.ops.selvedge.run()
            refused = False
        except RuntimeError as error:
            refused = "Select the empties" in str(error)
        selvedge_cloth.unregister()
        if not (rate == 24 and len(arrays["positions"]) == LAST + 1 and worst <= 1e-6 and off <= 1e-6 and moved > 0.05 and refused):
            sys.exit("the cache is not the run")


if __name__ == "__main__":
    main()
