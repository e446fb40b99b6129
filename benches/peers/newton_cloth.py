"""Newton's cloth on the processor: `vbd` or `style3d`.

Newton's membrane takes Lamé's constants per length, its bending a stiffness per hinge.
"""

import sys

import newton
import numpy as np
import warp as wp

import common

SOLVER = sys.argv.pop(1)
ITERATIONS = 10  # of a substep, Newton's own choice
GAP = 1e-3  # m


def lame(scene: common.Scene) -> tuple[float, float]:
    """λ and μ of the sheet in plane stress, N/m."""
    stiffness, ratio = scene.membrane_stiffness, scene.poissons_ratio
    return stiffness * ratio / (1 - ratio**2), stiffness / (2 * (1 + ratio))


def hinge(scene: common.Scene, vertices: tuple[int, int, int, int]) -> tuple[float, float]:
    """Stiffness per length and damping of a hinge that bends as Selvedge's does: D l/A, A of both faces.

    vertices are the two tips and the two ends.
    """
    if min(vertices) < 0:
        return 0.0, 0.0
    tip, other, a, b = scene.positions[list(vertices)]
    area = sum(0.5 * np.linalg.norm(np.cross(b - a, far - a)) for far in (tip, other))
    stiffness = float(scene.plate_stiffness * np.linalg.norm(b - a) / area)
    return stiffness, scene.damping * stiffness


def model(scene: common.Scene) -> newton.Model:
    """The sheet and the ball."""
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -scene.gravity, 0.0))
    stretch, shear = lame(scene)
    common_values = {
        "pos": wp.vec3(0.0), "rot": wp.quat_identity(), "vel": wp.vec3(0.0),
        "vertices": [wp.vec3(*map(float, point)) for point in scene.positions],
        "indices": scene.faces.ravel().tolist(), "density": scene.density,
        "particle_radius": GAP, "tri_kd": scene.damping * shear,
    }
    if SOLVER == "style3d":
        newton.solvers.SolverStyle3D.register_custom_attributes(builder)
        bend = scene.plate_stiffness
        newton.solvers.style3d.add_cloth_mesh(
            builder, **common_values, panel_verts=[wp.vec2(float(z), float(x)) for x, _, z in scene.positions],
            tri_aniso_ke=wp.vec3(stretch + 2 * shear, stretch + 2 * shear, shear),
            edge_aniso_ke=wp.vec3(bend, bend, bend))
    else:
        builder.add_cloth_mesh(**common_values, scale=1.0, tri_ke=shear, tri_ka=stretch)
        builder.edge_bending_properties = [hinge(scene, edge) for edge in builder.edge_indices]
    for vertex in scene.held:
        builder.particle_mass[vertex] = 0.0
        builder.particle_flags[vertex] &= ~newton.ParticleFlags.ACTIVE
    if scene.ball:
        surface = newton.ModelBuilder.ShapeConfig(mu=scene.friction, ke=1e3, kd=1e-3)
        builder.add_shape_sphere(-1, radius=scene.ball, cfg=surface)
    if SOLVER == "vbd":
        builder.color(include_bending=True)
    made = builder.finalize(device="cpu")
    made.soft_contact_ke, made.soft_contact_kd, made.soft_contact_mu = 1e3, 1e-3, scene.friction
    return made


def solver(sheet: newton.Model):
    if SOLVER == "vbd":
        return newton.solvers.SolverVBD(sheet, iterations=ITERATIONS)
    return newton.solvers.SolverStyle3D(
        sheet, config=newton.solvers.SolverStyle3D.Config(iterations=ITERATIONS))


def prepare(scene: common.Scene, substeps: int, frames: int) -> common.Frame:
    sheet = model(scene)
    moves = solver(sheet)
    states = [sheet.state(), sheet.state()]
    control = sheet.control()
    pipeline = newton.CollisionPipeline(sheet)
    contacts = pipeline.contacts()
    step = 1 / (scene.rate * substeps)

    def frame() -> np.ndarray:
        for _ in range(substeps):
            states[0].clear_forces()
            if scene.ball:
                pipeline.collide(states[0], contacts)
            moves.step(states[0], states[1], control, contacts, step)
            states.reverse()
        return states[0].particle_q.numpy()

    warm = [state.particle_q.numpy().copy() for state in states]
    frame()  # compiles the kernels
    for state, positions in zip(states, warm):
        state.particle_q.assign(positions)
        state.particle_qd.zero_()
    return frame


wp.config.quiet = True
with wp.ScopedDevice("cpu"):
    common.main(prepare)
