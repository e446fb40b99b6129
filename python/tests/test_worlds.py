"""Forces on bodies, many worlds, and the tasks."""

import numpy as np
import pytest
import selvedge

LYING = """
name = "lies"
material = "gray-interlock"
start = "mesh"
mesh = {{ generator = {{ kind = "square", vertices = 36, size = 0.3, seed = {seed} }}, transform = {{ rotation = {{ axis = [0, 0, 1], angle_deg = 90 }} }} }}
obstacles = [{{ name = "table", box = {{ size = [2, 0.1, 2] }}, transform = {{ translation = [0, -0.051, 0] }} }}]
"""


def test_a_sheet_at_rest_weighs_what_it_weighs():
    scene = selvedge.Scene.parse(LYING.format(seed=1))
    stepper = selvedge.Simulator(scene)
    stepper.follow(90)
    (momentum, moment),  = stepper.impulses
    weight = scene.material.density * 0.09 * 9.8
    assert -60 * momentum[1] == pytest.approx(weight, rel=0.01)
    # The force acts at the middle of the sheet.
    middle = stepper.positions.mean(axis=0)
    assert moment == pytest.approx(np.cross(middle, momentum), abs=2e-2 * abs(momentum[1]))


def test_worlds_have_the_bytes_of_one_by_one():
    scenes = [selvedge.Scene.parse(LYING.format(seed=seed)) for seed in (1, 2, 3)]
    worlds = selvedge.Worlds(scenes)
    alone = [selvedge.Simulator(scene) for scene in scenes]
    shown = worlds.positions
    assert len(worlds) == 3 and shown.shape == (3, 36, 3) and not shown.flags.writeable
    for frame in range(20):
        assert worlds.step() == [None] * 3
        for one, stepper in zip(shown, alone):
            assert np.array_equal(one, stepper.step())
        if frame == 10:
            there = worlds.snapshot(1)
    assert worlds.impulses.shape == (3, 1, 2, 3)
    assert np.array_equal(worlds.impulses[2], alone[2].impulses)
    end = shown.copy()
    worlds.reset(0)
    worlds.restore(1, there)
    assert worlds.frames == [0, 11, 20]
    assert np.array_equal(shown[2], end[2])
    for _ in range(9):
        worlds.step()
    assert np.array_equal(shown[1], end[1])
    with pytest.raises(ValueError, match="world 3"):
        worlds.reset(3)
    with pytest.raises(ValueError, match="scene 1"):
        selvedge.Worlds([scenes[0], selvedge.Scene("default")])
    with pytest.raises(ValueError, match="targets"):
        worlds.step(np.zeros((3, 2, 3)))


@pytest.mark.parametrize("task, spacing", [("lift", 0.02), ("fold", 0.02), ("fling", 0.03)])
def test_the_scripted_policy_does_the_task(task, spacing):
    pytest.importorskip("gymnasium")
    from selvedge import tasks

    info = tasks.episode(task, 1, spacing=spacing)
    assert info["success"], info


def test_tasks_are_environments():
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    from selvedge import tasks

    check_env(tasks.TowelTask("fold", spacing=0.03), skip_render_check=True)
    worlds = gymnasium.make_vec("selvedge/LiftTowel-v0", num_envs=2, spacing=0.03, frames=5)
    observed, _ = worlds.reset(seed=3)
    alone = tasks.TowelTask("lift", spacing=0.03, frames=5)
    expected, _ = alone.reset(seed=4)
    assert np.array_equal(observed["positions"][1], expected["positions"])
    action = np.ones((2, 2, 4), np.float32)
    observed, *_ = worlds.step(action)
    expected, *_ = alone.step(action[1])
    assert np.array_equal(observed["positions"][1], expected["positions"])
    worlds.close()
    with pytest.raises(ValueError, match="none of lift"):
        tasks.TowelTask("iron")
