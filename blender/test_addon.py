"""Tries the add-on without a window: a cloth between two empties, one of which moves; on a ball that moves and is bent
by a modifier; by a model; a cape that an armature carries, in centimetres; a bake that is stopped.

    python blender/test_addon.py target/debug/selvedge

Needs bpy from PyPI. Exits with 1 where the cache that was loaded is not the run: every vertex of every frame is
compared with the trajectory, and the held ones with the empties.
"""

import sys
import tempfile
import time
import tomllib
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


def falls(folder):
    """Drops the grid onto a ball that rises; returns by how much a vertex is inside of the ball at the end, in metres."""
    made = bpy.context.scene
    made.frame_end = 36
    for item in made.objects:
        item.select_set(False)
    bodies = bpy.data.collections.new("bodies")
    made.collection.children.link(bodies)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(0.2, 0.1, 0.5))
    ball = bpy.context.object
    # Of half the size, by a modifier: what the add-on writes is what modifiers leave.
    shrink = ball.modifiers.new("shrink", "CAST")
    shrink.cast_type, shrink.factor, shrink.use_radius_as_size, shrink.radius, shrink.size = "SPHERE", 1.0, False, 0, 0.15
    for collection in list(ball.users_collection):
        collection.objects.unlink(ball)
    bodies.objects.link(ball)
    ball.keyframe_insert("location", frame=1)
    ball.location.z += 0.2
    ball.keyframe_insert("location", frame=36)
    made.selvedge.bodies = bodies
    made.selvedge.folder = str(folder)
    if bpy.ops.selvedge.run() != {"FINISHED"}:
        sys.exit((folder / "log.txt").read_text())
    arrays, _ = read_trajectory(folder / "run.safetensors")
    made.frame_set(36)
    seen = ball.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.asarray([seen.matrix_world @ vertex.co for vertex in seen.data.vertices])
    middle, radius = points.mean(axis=0), np.linalg.norm(points - points.mean(axis=0), axis=1).min()
    away = np.linalg.norm(arrays["positions"][-1] - y_up(middle), axis=1)
    fell = float((arrays["positions"][0] - arrays["positions"][-1])[:, 1].max())
    print(f"a ball of {radius:.3f} m: the nearest vertex is {away.min():.4f} m from its middle, one fell {fell:.2f} m")
    return radius - float(away.min()) if fell > 0.1 else 1.0


def refusal():
    """The words with which a bake is refused; empty where it is not."""
    try:
        bpy.ops.selvedge.run()
        return ""
    except RuntimeError as error:
        return str(error)


def cape(program, folder):
    """A cape in centimetres with loose vertices, whose upper row a bone carries: every pin of every frame that Blender
    shows is compared with the armature's. Returns the largest distance in centimetres; infinity where unit,
    gravity or the number of vertices is wrong."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    made = bpy.context.scene
    made.render.fps, made.frame_start, made.frame_end = 30, 1, LAST + 1
    made.unit_settings.scale_length = 0.01
    made.gravity = (0, 0, -490.5)
    side = np.linspace(-30, 30, 9)
    # The first vertex and one in the middle belong to no face.
    points = [(0, 0, 500)] + [(x, 0, 100 - 7.5 * row) for row in range(5) for x in side]
    points += [(1, 2, 3)] + [(x, 0, 100 - 7.5 * row) for row in range(5, 9) for x in side]
    number = lambda row, column: 1 + 9 * row + column + (row >= 5)
    faces = [[number(r, c), number(r + 1, c), number(r + 1, c + 1), number(r, c + 1)] for r in range(8) for c in range(8)]
    mesh = bpy.data.meshes.new("cape")
    mesh.from_pydata(points, [], faces)
    item = bpy.data.objects.new("cape", mesh)
    made.collection.objects.link(item)
    group = item.vertex_groups.new(name="shoulders")
    group.add([0] + [number(0, column) for column in range(9)], 1.0, "REPLACE")
    group.add([number(8, 0)], 0.4, "REPLACE")
    bpy.ops.object.armature_add(enter_editmode=True, location=(0, 0, 0))
    rig = bpy.context.object
    rig.data.edit_bones[0].name = "chest"
    rig.data.edit_bones[0].tail = (0, 0, 100)
    bpy.ops.object.mode_set(mode="OBJECT")
    every = item.vertex_groups.new(name="chest")
    every.add(list(range(len(points))), 1.0, "REPLACE")
    bends = item.modifiers.new("armature", "ARMATURE")
    bends.object = rig
    bone = rig.pose.bones["chest"]
    bone.rotation_mode = "XYZ"
    for frame, lean in ((1, 0.0), (LAST + 1, 0.4)):
        bone.rotation_euler, bone.location = (lean, 0.5 * lean, 0), (40 * lean, 0, 0)
        bone.keyframe_insert("rotation_euler", frame=frame)
        bone.keyframe_insert("location", frame=frame)
    settings = made.selvedge
    settings.mesh, settings.pins, settings.program, settings.folder = item, "shoulders", program, str(folder)
    if bpy.ops.selvedge.run() != {"FINISHED"}:
        sys.exit((folder / "log.txt").read_text())
    cloth = bpy.data.objects["cape cloth"]
    off, swung = 0.0, 0.0
    for frame in range(1, LAST + 2):
        made.frame_set(frame)
        shown = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get())
        led = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
        at = lambda one, k: one.matrix_world @ one.data.vertices[k].co
        off = max(off, max((at(shown, column) - at(led, 1 + column)).length for column in range(9)))
        swung = (at(shown, 80) - at(led, number(8, 8))).length
    text = tomllib.loads((folder / "scene.toml").read_text())
    print(f"a cape of {len(cloth.data.vertices)} vertices on a bone: pins {off:.1e} cm off, its hem swings {swung:.1f} cm")
    settings.by_pattern = True
    unmapped = refusal()
    settings.by_pattern, settings.bodies = False, bpy.data.collections.new("nobody")
    bodiless = refusal()
    if "has no texture coordinates" not in unmapped or "nobody has no mesh" not in bodiless:
        sys.exit(f"not refused: {unmapped}, {bodiless}")
    right = len(cloth.data.vertices) == 81 and np.allclose(text["environment"]["gravity"], [0, -4.905, 0]) and 5 < swung < 60
    return off if right else float("inf")


def stopped(program, folder):
    """Stops a long bake once the program says how far it is; returns true if it leaves no object."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    made, settings = bpy.context.scene, bpy.context.scene.selvedge
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=99, y_subdivisions=99, size=1)
    settings.mesh, settings.pins = bpy.context.object, "edge"
    settings.mesh.vertex_groups.new(name="edge").add(list(range(100)), 1.0, "REPLACE")
    settings.program, settings.folder = program, str(folder)
    made.frame_end = 2000
    before = len(bpy.data.objects), len(bpy.data.meshes)
    bake = selvedge_cloth.Bake(bpy.context)
    while bake.is_running() and not bake.progress():
        time.sleep(0.2)
    seen, was_running = bake.progress(), bake.is_running()
    bake.cancel()
    print(f"stopped at {seen:.0%}: {bake.said()}")
    return was_running and 0 < seen < 1 and not bake.is_running() and before == (len(bpy.data.objects), len(bpy.data.meshes))


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
        refused = "Choose the vertex group" in refusal()
        for hand in hands:
            hand.select_set(True)
        made = bpy.context.scene
        made.selvedge.model, made.selvedge.folder = "paper", str(folder / "by-model")
        made.render.fps = 60
        bake = selvedge_cloth.Bake(bpy.context)
        by_model = bake.end(bpy.context) and (folder / "by-model/cloth.pc2").exists() and any("out of distribution" in line for line in bake.warnings())
        made.selvedge.model = ""
        (folder / "ball").mkdir()
        inside = falls(folder / "ball")
        (folder / "cape").mkdir()
        (folder / "stopped").mkdir()
        loose = cape(program, folder / "cape")
        stops = stopped(program, folder / "stopped")
        selvedge_cloth.unregister()
        if loose > 1e-4 or not stops:
            sys.exit(f"pins {loose} cm off, stopped {stops}")
        # Between its points the ball's faces lie within the sphere.
        if not by_model or inside > 0.01:
            sys.exit(f"model {by_model}, {inside} m inside of the ball")
        if not (rate == 24 and len(arrays["positions"]) == LAST + 1 and worst <= 1e-6 and off <= 1e-6 and moved > 0.05 and refused):
            sys.exit("the cache is not the run")


if __name__ == "__main__":
    main()
