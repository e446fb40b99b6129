"""The gripper of MuJoCo that lifts a towel and feels it."""

import pathlib
import runpy

import pytest

EXAMPLE = pathlib.Path(__file__).parents[1] / "examples" / "mujoco_gripper.py"


def test_a_gripper_of_mujoco_lifts_a_towel_and_feels_its_weight():
    felt = runpy.run_path(str(EXAMPLE))["run"]()
    # Of 15 cm; its lower corners sag by some when the upper ones are let go.
    assert felt["risen"] > 0.1
    # The arm bears the towel, by both fingers, which squeeze it alike.
    assert felt["arm"] == pytest.approx(felt["weight"], rel=0.1)
    assert sum(force[1] for force in felt["on_fingers"]) == pytest.approx(-felt["weight"], rel=0.1)
    left, right = felt["squeeze"]
    assert left == pytest.approx(right, rel=0.02)
    assert left == pytest.approx(abs(felt["on_fingers"][0][0]), rel=0.05)
