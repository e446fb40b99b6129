"""Makes caches of a cloth that Blender moves, for a model to learn from.

A square sheet of 1 m and 400 vertices hangs from its two upper corners, vertices 380 and 399. It
settles for three seconds. Then an empty, to which the corners are hooked, moves it for four
seconds, and stands still for one. Each motion becomes an .npz of 301 frames at 60 per second, z up, and
an .obj. All begin with the same frame. Texture coordinates are the flat sheet's, in metres.

    pip install bpy==5.0.1          # Python 3.11
    python benches/blender/cloth_cache.py out/blender-cloth [MOTION ...]
"""

import math
import os
import random
import sys
import time

import bpy
import numpy as np
from mathutils import Vector

RATE = 60
SIDE = 20  # vertices
SETTLING, MOVING, STILL = 180, 240, 60  # frames
# What Blender's cloth takes for the duration of a frame, whatever the scene's rate, in s: without
# pins and air a sheet gets faster by 9.81 m/s in a second of such frames (measured with 5.0.1).
BLENDERS_FRAME = math.sqrt(0.001)

# Directions in Blender's axes (x to the right, y away, z up) with lengths in m, or a turn about z
# in radians. Each is gone to and back again twice. The diagonal is no multiple of any other.
MOTIONS = {
    "forward": (0.0, -0.7, 0.0),
    "backward": (0.0, 0.7, 0.0),
    "side": (0.7, 0.0, 0.0),
    "up": (0.0, 0.0, 0.5),
    "down": (0.0, 0.0, -0.5),
    "turn": 1.2,
    "diagonal": (0.4, -0.5, 0.25),
}


def sheet():
    """Makes the sheet, in the plane of x and z, with ripples of 1 mm that decide how it folds."""
    chance = random.Random(1)
    step = 1.0 / (SIDE - 1)
    flat = [(i * step, j * step) for j in range(SIDE) for i in range(SIDE)]
    faces = []
    for j in range(SIDE - 1):
        for i in range(SIDE - 1):
            a, b = j * SIDE + i, j * SIDE + i + 1
            c, d = b + SIDE, a + SIDE
            faces += [(a, b, c), (a, c, d)] if (i + j) % 2 == 0 else [(a, b, d), (b, c, d)]
    mesh = bpy.data.meshes.new("sheet")
    ripples = [chance.uniform(-0.001, 0.001) for _ in flat]
    mesh.from_pydata([(u - 0.5, y, v - 1.0) for (u, v), y in zip(flat, ripples)], [], faces)
    coordinates = mesh.uv_layers.new(name="material")
    for loop in mesh.loops:
        coordinates.data[loop.index].uv = flat[loop.vertex_index]
    cloth = bpy.data.objects.new("sheet", mesh)
    bpy.context.scene.collection.objects.link(cloth)
    held = cloth.vertex_groups.new(name="held")
    held.add([SIDE * (SIDE - 1), SIDE * SIDE - 1], 1.0, "REPLACE")
    return cloth


def cotton(cloth, frames):
    """Gives the sheet Blender's cloth, with the values of its preset for cotton."""
    modifier = cloth.modifiers.new("cloth", "CLOTH")
    settings = modifier.settings
    settings.quality = 8
    settings.time_scale = 1.0 / (RATE * BLENDERS_FRAME)
    # kg of a vertex; with a much smaller one Blender's solver lets a free sheet fall too slowly.
    settings.mass = 0.3
    settings.air_damping = 1.0
    settings.tension_stiffness = settings.compression_stiffness = settings.shear_stiffness = 15.0
    settings.tension_damping = settings.compression_damping = settings.shear_damping = 5.0
    settings.bending_stiffness = 0.5
    settings.bending_damping = 0.5
    settings.vertex_group_mass = "held"
    modifier.collision_settings.use_collision = False
    modifier.point_cache.frame_start, modifier.point_cache.frame_end = 1, frames


def animate(hand, motion):
    """Keys the empty that the corners go with, on every frame."""
    for frame in range(MOVING + 1):
        way = 0.5 - 0.5 * math.cos(4.0 * math.pi * frame / MOVING)
        # The first swing sets in softly.
        way *= min(1.0, frame / (MOVING / 4.0)) ** 2
        if isinstance(motion, float):
            hand.rotation_euler = (0.0, 0.0, motion * way)
            hand.keyframe_insert("rotation_euler", frame=1 + SETTLING + frame)
        else:
            hand.location = Vector(motion) * way
            hand.keyframe_insert("location", frame=1 + SETTLING + frame)


def make(name, folder):
    """Runs one motion and writes its cache."""
    began = time.time()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = RATE
    last = 1 + SETTLING + MOVING + STILL
    scene.frame_start, scene.frame_end = 1, last
    cloth = sheet()
    hand = bpy.data.objects.new("hand", None)
    scene.collection.objects.link(hand)
    hook = cloth.modifiers.new("hand", "HOOK")
    hook.object, hook.vertex_group = hand, "held"
    cotton(cloth, last)
    animate(hand, MOTIONS[name])
    frames = []
    for frame in range(1, last + 1):  # in order, for the cloth's cache
        scene.frame_set(frame)
        if frame > SETTLING:
            seen = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get())
            frames.append([tuple(cloth.matrix_world @ v.co) for v in seen.data.vertices])
    np.savez(os.path.join(folder, name + ".npz"), positions=np.array(frames), fps=np.array([float(RATE)]))
    uv = {loop.vertex_index: tuple(cloth.data.uv_layers[0].data[loop.index].uv) for loop in cloth.data.loops}
    lines = ["v %r %r %r" % tuple(p) for p in frames[0]] + ["vt %r %r" % uv[k] for k in range(len(uv))]
    lines += ["f " + " ".join(f"{v + 1}/{v + 1}" for v in face.vertices) for face in cloth.data.polygons]
    with open(os.path.join(folder, name + ".obj"), "w") as mesh:
        mesh.write("\n".join(lines) + "\n")
    print(f"{name}: {time.time() - began:.1f} s", flush=True)


if __name__ == "__main__":
    os.makedirs(sys.argv[1], exist_ok=True)
    for motion in sys.argv[2:] or MOTIONS:
        make(motion, os.path.abspath(sys.argv[1]))
