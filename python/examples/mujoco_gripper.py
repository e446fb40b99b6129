"""A gripper of MuJoCo lifts a towel of Selvedge, and feels it. Needs mujoco.

    python mujoco_gripper.py

MuJoCo moves the arm and its two fingers by their motors. After each frame the fingers lead the bodies of
the cloth's scene; what these received from the cloth pushes the fingers in the next frame. The motors must be
stiffer than the fabric is under pressure, as those of a gripper are: a body that answers a frame late would be
thrown otherwise.
"""

import mujoco
import numpy as np
import selvedge

PAD = (0.02, 0.03, 0.03)
FRICTION = 0.6

SCENE = f"""
name = "towel"
material = "gray-interlock"
mesh = {{ generator = {{ kind = "square", vertices = 400, size = 0.3, seed = 1 }} }}
handles = {{ label = "upper-corners" }}
start = "mesh"
environment = {{ air_density = 0.2 }}
contact = {{ thickness = 0.001, friction = {FRICTION} }}
obstacles = [
    {{ name = "left", box = {{ size = {list(PAD)} }}, transform = {{ translation = [-0.03, -0.02, 0] }} }},
    {{ name = "right", box = {{ size = {list(PAD)} }}, transform = {{ translation = [0.03, -0.02, 0] }} }},
]
"""

# The arm goes up and down, the fingers along x; the axes are those of Selvedge, with y up.
ROBOT = f"""
<mujoco>
  <option timestep="{1 / 240}" gravity="0 -9.8 0" integrator="implicitfast"/>
  <worldbody>
    <body name="arm" pos="0 -0.02 0">
      <joint name="up" type="slide" axis="0 1 0" damping="200"/>
      <geom type="box" size="0.06 0.01 0.01" pos="0 0.06 0" mass="0.5" contype="0" conaffinity="0"/>
      {"".join(f'''
      <body name="{name}" pos="{x} 0 0">
        <joint name="{name}" type="slide" axis="1 0 0" damping="500"/>
        <geom type="box" size="0.01 0.015 0.015" mass="0.1" contype="0" conaffinity="0"/>
      </body>''' for name, x in [("left", -0.03), ("right", 0.03)])}
    </body>
  </worldbody>
  <actuator>
    <position name="up" joint="up" kp="20000"/>
    <position name="left" joint="left" kp="200000"/>
    <position name="right" joint="right" kp="200000"/>
  </actuator>
</mujoco>
"""


class Gripper:
    """The robot and the towel."""

    def __init__(self):
        scene = selvedge.Scene.parse(SCENE)
        self.cloth, self.weight = selvedge.Simulator(scene), 9.8 * 0.09 * scene.material.density
        self.model = mujoco.MjModel.from_xml_string(ROBOT)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.fingers = [self.model.body(name).id for name in ("left", "right")]
        self.begin = [self.pose(finger) for finger in self.fingers]
        self.held = self.cloth.positions[self.cloth.handles].copy()

    def pose(self, body):
        """Where a body is, a matrix (4, 4)."""
        pose = np.eye(4)
        pose[:3, :3] = self.data.xmat[body].reshape(3, 3)
        pose[:3, 3] = self.data.xpos[body]
        return pose

    def step(self, closed, height, holds):
        """A frame in which the fingers close by `closed` and the arm goes to `height` [m]; the corners of the
        towel are held or let go. Returns the force of each finger's cloth, (2, 3) [N]."""
        self.data.ctrl[:] = [height, closed, -closed]
        for _ in range(round(1 / (self.cloth.frame_rate * self.model.opt.timestep))):
            mujoco.mj_step(self.model, self.data)
        mujoco.mj_kinematics(self.model, self.data)
        for number, (finger, begin) in enumerate(zip(self.fingers, self.begin)):
            self.cloth.lead_body(number, self.pose(finger) @ np.linalg.inv(begin))
        self.cloth.step(self.held, [not holds] * len(self.held))
        received = self.cloth.impulses * self.cloth.frame_rate
        for finger, (force, moment) in zip(self.fingers, received):
            # MuJoCo takes the torque about the middle of the body.
            torque = moment - np.cross(self.data.xipos[finger], force)
            self.data.xfrc_applied[finger] = [*force, *torque]
        return received[:, 0]

    def motor(self):
        """Forces of the motors: of the arm, of the left and of the right finger [N]."""
        return self.data.actuator_force.copy()


def run(lift=0.15):
    """Closes the fingers, lets the corners go, lifts, and holds still. Returns how far the lower edge rose, whose
    corners sag when they are let go [m], and what motors and fingers feel [N]."""
    robot = Gripper()
    for _ in range(10):
        robot.step(0.0, 0.0, True)
    alone = robot.motor()[0]
    for frame in range(30):
        robot.step(0.0197 * min(1.0, frame / 20), 0.0, True)
    low = robot.cloth.positions[:, 1].min()
    for frame in range(150):
        part = np.clip((frame - 20) / 50, 0, 1)
        forces = robot.step(0.0197, lift * (3 * part**2 - 2 * part**3), False)
    motor = robot.motor()
    return {
        "risen": float(robot.cloth.positions[:, 1].min() - low),
        "weight": robot.weight,
        "arm": float(motor[0] - alone),
        "squeeze": np.abs(motor[1:]).tolist(),
        "on_fingers": forces.tolist(),
    }


if __name__ == "__main__":
    for name, value in run().items():
        print(f"{name:>10}: {value}")
