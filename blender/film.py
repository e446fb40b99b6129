"""Bakes a cape on the walking mannequin with the add-on, without a window, and renders the film of the README.

    python blender/film.py target/release/selvedge docs/src/images/blender-cape.gif

Needs bpy from PyPI, and Pillow for the film.
"""

import sys
import tempfile
from math import cos, radians, sin
from pathlib import Path

import bpy
from mathutils import Matrix, Vector
from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import selvedge_cloth  # noqa: E402

FRAMES, SETTLED, RATE, SIZE = 84, 13, 30, 320


def character(scene):
    """The mannequin, which walks along a circle; its armature."""
    bpy.ops.import_scene.gltf(filepath=str(HERE.parent / "assets/bodies/mannequin.glb"))
    rig = next(item for item in bpy.data.objects if item.type == "ARMATURE")
    for item in list(bpy.data.objects):
        if item.type == "MESH" and item.parent != rig:
            bpy.data.objects.remove(item)
    rig.animation_data.action = bpy.data.actions["walk"]
    if not rig.animation_data.action_slot:
        rig.animation_data.action_slot = rig.animation_data.action_suitable_slots[0]
    # Its own clip walks on the spot; an empty takes it around.
    bpy.ops.object.empty_add()
    lead = bpy.context.object
    rig.parent = lead
    for frame in range(1, FRAMES + 1):
        angle = radians(100) * (frame - 1) / FRAMES
        lead.location = (1.2 * sin(angle), -1.2 * cos(angle), 0)
        lead.rotation_euler = (0, 0, angle + radians(90))
        lead.keyframe_insert("location", frame=frame)
        lead.keyframe_insert("rotation_euler", frame=frame)
    return rig


def cape(rig):
    """A sheet behind the shoulders, whose upper edge the chest carries."""
    wide, high = 24, 38
    across = lambda column, row: (0.22 + 0.10 * row / high) * (2 * column / wide - 1)
    points = [(across(c, r), 0.17, 1.44 - 1.0 * r / high) for r in range(high + 1) for c in range(wide + 1)]
    at = lambda r, c: r * (wide + 1) + c
    faces = [(at(r, c), at(r + 1, c), at(r + 1, c + 1), at(r, c + 1)) for r in range(high) for c in range(wide)]
    mesh = bpy.data.meshes.new("cape")
    mesh.from_pydata(points, [], faces)
    item = bpy.data.objects.new("cape", mesh)
    bpy.context.scene.collection.objects.link(item)
    item.vertex_groups.new(name="chest").add(list(range(len(points))), 1.0, "REPLACE")
    item.vertex_groups.new(name="pins").add(list(range(wide + 1)), 1.0, "REPLACE")
    item.modifiers.new("armature", "ARMATURE").object = rig
    item.parent = rig
    red = bpy.data.materials.new("red")
    red.diffuse_color = (0.4, 0.03, 0.05, 1)
    mesh.materials.append(red)
    return item


def main():
    program, film = sys.argv[1:3]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    selvedge_cloth.register()
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = RATE, 1, FRAMES
    rig = character(scene)
    bodies = bpy.data.collections.new("bodies")
    scene.collection.children.link(bodies)
    for part in list(rig.children):
        bodies.objects.link(part)
    scene.frame_set(1)
    settings = scene.selvedge
    settings.mesh, settings.pins, settings.bodies = cape(rig), "pins", bodies
    settings.program = str(Path(program).resolve())
    for item in bpy.context.selected_objects:
        item.select_set(False)
    with tempfile.TemporaryDirectory() as folder:
        settings.folder = folder
        if bpy.ops.selvedge.run() != {"FINISHED"}:
            sys.exit((Path(folder) / "log.txt").read_text())
        print((Path(folder) / "log.txt").read_text())
        cloth = bpy.data.objects["cape cloth"]
        for item in [cloth, *bodies.objects]:
            item.data.shade_smooth()
        scene.world = bpy.data.worlds.new("light")
        scene.world.color = (0.85, 0.82, 0.76)
        scene.view_settings.view_transform = "Standard"
        bpy.ops.mesh.primitive_plane_add(size=30)
        floor = bpy.context.object.data
        floor.materials.append(bpy.data.materials.new("floor"))
        floor.materials[0].diffuse_color = (0.75, 0.72, 0.66, 1)
        eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
        scene.collection.objects.link(eye)
        scene.camera = eye
        render = scene.render
        render.engine = "BLENDER_WORKBENCH"
        scene.display.shading.light, scene.display.shading.color_type = "STUDIO", "MATERIAL"
        scene.display.shading.show_shadows = scene.display.shading.show_cavity = True
        scene.display.render_aa = "8"
        render.resolution_x = render.resolution_y = SIZE
        pictures = []
        # Before, the sheet settles.
        for frame in range(SETTLED, FRAMES + 1, 2):
            scene.frame_set(frame)
            chest = rig.matrix_world @ Vector((0, 0, 0.9))
            place = chest + rig.matrix_world.to_3x3() @ Matrix.Rotation(radians(30), 3, "Z") @ Vector((0, 3.6, 0.5))
            eye.matrix_world = Matrix.LocRotScale(place, (chest - place).to_track_quat("-Z", "Y"), None)
            render.filepath = f"{folder}/{frame:03}.png"
            bpy.ops.render.render(write_still=True)
            pictures.append(Image.open(render.filepath).convert("RGB").quantize(64))
        pictures[0].save(film, save_all=True, append_images=pictures[1:], duration=2000 // RATE, loop=0)


if __name__ == "__main__":
    main()
