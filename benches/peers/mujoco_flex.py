"""MuJoCo's flex, with its discrete integrator: elasticity is implicit there.

The same energies as Selvedge's isotropic sheet: Saint Venant-Kirchhoff in the plane, hinges that
are calibrated to a plate. Vertices have equal masses (flexcomp has no others). The pins are fixed.
Contact by the constraint solver, with an elliptic cone; the gap of the sheet is 1 mm.
"""

import mujoco
import numpy as np

import common

GAP = 1e-3  # m


def model(scene: common.Scene, substeps: int) -> mujoco.MjModel:
    """The scene as MJCF."""
    points = " ".join(f"{x:.9g}" for x in scene.positions.ravel())
    elements = " ".join(str(k) for k in scene.faces.ravel())
    ball = scene.ball and f'<geom type="sphere" size="{scene.ball}" friction="{scene.friction} 0 0"/>'
    pins = scene.held and f'<pin id="{" ".join(map(str, scene.held))}"/>'
    return mujoco.MjModel.from_xml_string(f"""
      <mujoco>
        <option timestep="{1 / (scene.rate * substeps)}" gravity="0 {-scene.gravity} 0"
                integrator="discrete" cone="elliptic"/>
        <size memory="500M"/>
        <worldbody>
          {ball or ""}
          <flexcomp name="sheet" type="direct" dim="2" radius="{GAP / 2}" mass="{scene.masses.sum()}"
                    point="{points}" element="{elements}">
            <elasticity young="{scene.youngs_modulus}" poisson="{scene.poissons_ratio}"
                        thickness="{scene.thickness}" damping="{scene.damping}" elastic2d="both"/>
            <contact selfcollide="none" condim="3" friction="{scene.friction} 0 0"/>
            {pins or ""}
          </flexcomp>
        </worldbody>
      </mujoco>""")


def prepare(scene: common.Scene, substeps: int, frames: int) -> common.Frame:
    sheet = model(scene, substeps)
    data = mujoco.MjData(sheet)
    mujoco.mj_forward(sheet, data)

    def frame() -> np.ndarray:
        number = round(data.time * scene.rate) + 1
        sheet.opt.gravity[1] = -scene.gravity_at(number)
        for _ in range(substeps):
            mujoco.mj_step(sheet, data)
        return data.flexvert_xpos.copy()

    return frame


common.main(prepare)
