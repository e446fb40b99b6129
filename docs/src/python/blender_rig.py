"""Makes a rig in Blender that Selvedge's handles follow, writes it as hands.glb and hands.usda, and compares runs of them.

    python docs/src/python/blender_rig.py
    selvedge info hands.glb
    selvedge run glb.toml -o glb.safetensors
    selvedge run usda.toml -o usda.safetensors
    python docs/src/python/blender_rig.py glb.safetensors usda.safetensors

with, in the scenes,

    motion = { rig = { file = "hands.glb" } }     # and "hands.usda" in the other

Two empties, handle_0 and handle_1, hang in a third one, which rises while it turns about its vertical by a quarter
in a second; Blender's own interpolation (Bezier, eased) is kept by sampling. With runs, their handles are compared in
every frame with where Blender's own placements put them, p(t) = M(t) M(0)^-1 p(0); exits with 1 if one is farther than
1e-6 m from there. Needs numpy and bpy from PyPI (Blender 4.2, Python 3.11); the body of make() can be run in Blender's
own console.
"""

import math
import sys

import bpy
import numpy as np
from check_exports import read_trajectory

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


# From a world with z up to ours, and back.
TURN = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)


def placements(hands):
    """World matrices of the hands in every frame, y up: [frames, hands, 4, 4]."""
    frames = []
    for frame in range(1, LAST + 1):
        bpy.context.scene.frame_set(frame)
        frames.append([TURN @ np.array(hand.matrix_world, float) @ TURN.T for hand in hands])
    return np.array(frames)


def compare(matrices, path):
    arrays, rate = read_trajectory(path)
    held = arrays["positions"][:, arrays["handles"]].astype(np.float64)
    if rate != RATE or held.shape[1] != matrices.shape[1]:
        sys.exit(f"{path}: {held.shape[1]} handles at {rate} frames per second, expected {matrices.shape[1]} at {RATE}")
    count = min(len(held), len(matrices))
    start = np.concatenate([held[0], np.ones((held.shape[1], 1))], axis=1)
    local = np.einsum("hij,hj->hi", np.linalg.inv(matrices[0]), start)
    expected = np.einsum("fhij,hj->fhi", matrices[:count], local)[..., :3]
    off = np.linalg.norm(held[:count] - expected, axis=2).max()
    print(f"{path}: {count} frames, handles at most {off:.1e} m off")
    return off <= 1e-6


def main():
    hands = make()
    matrices = placements(hands)
    if len(sys.argv) > 1:
        sys.exit(0 if all([compare(matrices, path) for path in sys.argv[1:]]) else 1)
    bpy.ops.export_scene.gltf(filepath="hands.glb", export_format="GLB", export_force_sampling=True)
    bpy.ops.wm.usd_export(filepath="hands.usda", export_animation=True)


if __name__ == "__main__":
    main()
