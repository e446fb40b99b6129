"""Blender's cloth through bpy. A substep is one of its quality steps.

Springs and hinges have one stiffness each. Blender divides the first by the mean length of a spring
and multiplies the second by a tenth of the hinge's length; that is undone here. With vertices much
lighter than 0.1 kg its solver lets a sheet fall too slowly, so every vertex has that, and all
stiffnesses are as many times as large. It has one damping per kind, no Poisson's ratio, and no
coefficient of friction of Coulomb's.
"""

import math

import bpy
import numpy as np

import common

VERTEX_MASS = 0.1  # kg
GAP = 1e-3  # m; Blender's least
# What Blender's cloth takes for the duration of a frame, in s (see ../blender/cloth_cache.py).
BLENDERS_FRAME = math.sqrt(0.001)


def to_blender(points: np.ndarray) -> np.ndarray:
    """Points with y up in Blender's axes, z up."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def from_blender(points: np.ndarray) -> np.ndarray:
    """The inverse."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def add_object(name: str, positions: np.ndarray, faces: np.ndarray) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(to_blender(positions).tolist(), [], faces.tolist())
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def add_ball(scene: common.Scene) -> None:
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4, radius=scene.ball)
    ball = bpy.context.active_object
    ball.modifiers.new("collision", "COLLISION")
    ball.collision.thickness_outer = GAP
    ball.collision.cloth_friction = 100 * scene.friction


def add_cloth(sheet: bpy.types.Object, scene: common.Scene, substeps: int, frames: int) -> None:
    """Gives the sheet Blender's cloth."""
    if scene.held:
        sheet.vertex_groups.new(name="held").add(scene.held, 1.0, "REPLACE")
    modifier = sheet.modifiers.new("cloth", "CLOTH")
    settings, collision = modifier.settings, modifier.collision_settings
    heavier = VERTEX_MASS * len(scene.positions) / scene.masses.sum()
    ends = scene.positions[scene.edges]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    spring = heavier * scene.membrane_stiffness * BLENDERS_FRAME**2
    hinge = heavier * scene.plate_stiffness * BLENDERS_FRAME**2
    damping = scene.damping / BLENDERS_FRAME
    settings.quality = substeps
    settings.time_scale = 1.0 / (scene.rate * BLENDERS_FRAME)
    settings.mass = VERTEX_MASS
    settings.air_damping = 0.0
    settings.tension_stiffness = settings.compression_stiffness = spring * lengths.mean()
    settings.shear_stiffness = spring * lengths.mean() / 2
    settings.tension_damping = settings.compression_damping = damping * spring
    settings.shear_damping = damping * spring / 2
    settings.bending_model = "ANGULAR"
    settings.bending_stiffness = hinge * 10 / lengths.min()
    settings.bending_damping = damping * hinge
    settings.vertex_group_mass = "held" if scene.held else ""
    collision.use_collision = scene.ball is not None
    collision.distance_min = GAP
    collision.friction = 100 * scene.friction
    collision.use_self_collision = False
    modifier.point_cache.frame_start, modifier.point_cache.frame_end = 1, frames + 1


def prepare(scene: common.Scene, substeps: int, frames: int) -> common.Frame:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.context.scene
    world.render.fps = scene.rate
    world.render.threads_mode, world.render.threads = "FIXED", 1
    world.frame_start, world.frame_end = 1, frames + 1
    world.gravity = (0.0, 0.0, -scene.gravity)
    sheet = add_object("sheet", scene.positions, scene.faces)
    add_cloth(sheet, scene, substeps, frames)
    if scene.ball:
        add_ball(scene)
    world.frame_set(1)
    points = np.empty(scene.positions.size, dtype=np.float32)

    def frame() -> np.ndarray:
        world.gravity = (0.0, 0.0, -scene.gravity_at(world.frame_current))
        world.frame_set(world.frame_current + 1)
        moved = sheet.evaluated_get(bpy.context.evaluated_depsgraph_get())
        moved.data.vertices.foreach_get("co", points)
        return from_blender(points.reshape(-1, 3))

    return frame


common.main(prepare)
