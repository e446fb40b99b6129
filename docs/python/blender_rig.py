"""Makes a rig in Blender that Selvedge's handles follow, and writes it as hands.glb and hands.usda.

    python docs/python/blender_rig.py
    selvedge inspect hands.glb
    selvedge simulate scene.toml --out run.safetensors

with, in the scene,

    motion = { rig = { file = "hands.glb" } }

Two empties, handle_0 and handle_1, hang in a third one, which rises while it turns about its vertical by a quarter
in a second; Blender's own interpolation (Bezier, eased) is kept by sampling. Then both files are compared with what
Blender shows. Needs bpy from PyPI (Blender 4.2, Python 3.11); the body of make() can be run in Blender's own console.
"""

import math

import bpy

RATE = 60
LAST = 61


def make():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = RATE
    scene.frame_start, scene.frame_end = 1, LAST

    def empty(name, place, parent=None):
        item = bpy.data.objects.new(name, None)
        item.location, item.parent = place, parent
        scene.collection.objects.link(item)
        return item

    rig = empty("rig", (0, 0, 1))
    hands = [empty(f"handle_{k}", place, rig) for k, place in enumerate([(0, -0.5, 0), (0, 0.5, 0)])]
    for frame, height, angle in [(1, 1.0, 0), (LAST, 1.3, math.pi / 2)]:
        rig.location.z = height
        rig.rotation_euler.z = angle
        rig.keyframe_insert("location", frame=frame)
        rig.keyframe_insert("rotation_euler", frame=frame)
    return hands


def main():
    hands = make()
    bpy.ops.export_scene.gltf(filepath="hands.glb", export_format="GLB", export_force_sampling=True)
    bpy.ops.wm.usd_export(filepath="hands.usda", export_animation=True)
    print("frame, then x, y, z of handle_0 and handle_1 with y up")
    for frame in [1, 16, 31, 46, LAST]:
        bpy.context.scene.frame_set(frame)
        places = [hand.matrix_world.translation for hand in hands]
        print(frame, *(f"{value:.6f}" for x, y, z in places for value in (x, z, -y)))


if __name__ == "__main__":
    main()
