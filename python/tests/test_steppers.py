"""Steppers: arrays that are shared, errors with their words, level memory."""

import gc
import logging
import pathlib
import resource
import threading

import numpy as np
import pytest
import selvedge


def test_the_array_of_positions_is_one_and_cannot_be_written(small):
    stepper = selvedge.Simulator(small)
    positions = stepper.positions
    before = positions.copy()
    # The handles stand still for a second.
    stepper.follow(70)
    assert stepper.positions is positions
    assert not np.array_equal(positions, before)
    assert positions.dtype == np.float32 and positions.shape == (36, 3)
    with pytest.raises(ValueError, match="read-only"):
        positions[0] = 0


def test_steps_are_frames_of_their_own(small):
    stepper = selvedge.Simulator(small)
    start = stepper.positions.copy()
    frames = [stepper.step() for _ in range(70)]
    again = selvedge.Simulator(small).follow(70)
    assert np.array_equal(frames, again[1:]) and np.array_equal(start, again[0])
    assert not np.array_equal(frames[-1], frames[0])
    frames[0][0] = 0  # a copy, which is the caller's


def test_models_have_the_guard_of_the_program(scene, model):
    for stepper in [selvedge.LearnedStepper(scene, model), selvedge.LearnedStepper(scene, selvedge.Model())]:
        targets = stepper.positions[stepper.handles] + np.array([[0, 0, 0.2], [0, 0, -0.2]])
        for frame in range(1, 40):
            stepper.step(targets + [0.04 * frame, 0, 0])
        # Without one, edges of such a run are strained by far more.
        assert stepper.trust["largest_strain"] < 0.31


def test_the_steppers_of_the_guide_run(scene):
    guide = pathlib.Path(__file__).parents[2] / "docs/src/guides/python.md"
    blocks = guide.read_text("utf-8").split("```python\n")[1:]
    [block] = [block.split("```")[0] for block in blocks if "Stepper(" in block]
    found = {"selvedge": selvedge, "scene": scene}
    exec(block, found)
    assert found["positions"].shape == (400, 3)


def test_the_ten_lines_of_the_readme_run(capsys):
    readme = pathlib.Path(__file__).parents[2] / "README.md"
    [block] = [part.split("```")[0] for part in readme.read_text("utf-8").split("```python\n")[1:]]
    exec(block, {})
    assert capsys.readouterr().out == "the hem is 0.45 m above the floor\n"


def test_an_array_outlives_its_stepper(small):
    positions = selvedge.Simulator(small).positions
    gc.collect()
    assert np.isfinite(positions).all()


def test_handles_are_where_the_targets_are(scene, model):
    for stepper in [
        selvedge.Simulator(scene),
        selvedge.LearnedStepper(scene, model, guard="limit"),
        selvedge.RigidStepper(scene),
    ]:
        targets = stepper.positions[stepper.handles] + np.array([0.002, 0.0, 0.001])
        stepper.step(targets)
        assert stepper.frame == 1
        assert np.abs(stepper.positions[stepper.handles] - targets).max() < 1e-6, stepper


def test_following_is_stepping(small):
    one, other = selvedge.Simulator(small), selvedge.Simulator(small)
    frames = one.follow(20)
    assert frames.shape == (21, 36, 3)
    for frame in range(1, 21):
        other.step(other.next_targets())
        assert np.array_equal(frames[frame], other.positions)
    assert np.array_equal(one.positions, other.positions)


def test_a_simulator_goes_on_from_a_state(small):
    whole = selvedge.Simulator(small)
    whole.follow(63)
    again = selvedge.Simulator(small, whole.state_positions(), whole.state_velocities())
    held = whole.positions[whole.handles].astype(float)
    assert np.abs(whole.step(held) - again.step(held)).max() < 1e-4
    assert whole.kinetic_energy > 0


def test_a_wrong_step_changes_nothing_and_says_what_is_wrong(small):
    stepper = selvedge.Simulator(small)
    before = stepper.positions.copy()
    with pytest.raises(ValueError, match=r"must have the shape \(2, 3\).*found \[3, 3\]"):
        stepper.step(np.zeros((3, 3)))
    with pytest.raises(selvedge.SelvedgeError, match="target of handle 0 is not finite"):
        stepper.step(np.full((2, 3), np.nan))
    apart = stepper.positions[stepper.handles] + [[0, 0, -9], [0, 0, 9]]
    with pytest.raises(selvedge.FrameError, match="frame 1: ") as failed:
        stepper.step(apart)
    assert failed.value.frame == 1 and stepper.frame == 0
    assert np.array_equal(stepper.positions, before)


def test_a_guard_that_there_is_not_is_said(scene, model):
    with pytest.raises(ValueError, match="guard must be none or limit"):
        selvedge.LearnedStepper(scene, model, guard="strong")


def test_handles_let_go(small, scene, model):
    for stepper in [selvedge.Simulator(small), selvedge.LearnedStepper(scene, model)]:
        held = stepper.positions[stepper.handles].astype(float)
        for _ in range(10):
            stepper.step(held, released=[True, False])
        assert stepper.positions[stepper.handles[0], 1] < held[0, 1] - 0.01


def test_trust_is_there_where_a_guard_is(scene, model, small):
    guarded = selvedge.LearnedStepper(scene, model, guard="limit")
    guarded.step()
    assert guarded.trust["verdict"] == "held" and guarded.trust["frame"] == 1
    assert 0 < guarded.trust["largest_strain"] < 0.3
    assert selvedge.Simulator(small).trust is None


def test_a_recording_is_a_stepper(small):
    run = selvedge.simulate(small, frames=5)
    playback = selvedge.PlaybackStepper(run)
    with pytest.raises(ValueError, match="targets are missing"):
        playback.step()
    for frame in range(1, 6):
        assert np.array_equal(playback.step(np.zeros((2, 3))), run.positions[frame])
    with pytest.raises(selvedge.FrameError, match="only 6 frames"):
        playback.step(np.zeros((2, 3)))


def test_other_threads_run_while_cloth_moves(scene):
    stepper = selvedge.Simulator(scene)
    stepper.step()
    counted = [0]
    end = threading.Event()

    def count():
        while not end.is_set():
            counted[0] += 1

    other = threading.Thread(target=count)
    other.start()
    before = counted[0]
    stepper.follow(20)
    made = counted[0] - before
    end.set()
    other.join()
    assert made > 1000


def test_one_stepper_is_not_moved_by_two_threads(scene):
    stepper = selvedge.Simulator(scene)
    moving = threading.Thread(target=stepper.follow, args=(200,))
    moving.start()
    said = None
    while moving.is_alive() and said is None:
        try:
            stepper.frame
        except RuntimeError as error:
            said = str(error)
    moving.join()
    assert said is not None and "moving in another thread" in said


def test_memory_stays_level(small):
    stepper = selvedge.Simulator(small)
    held = stepper.positions[stepper.handles].astype(float)

    def peak():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    for _ in range(2000):
        stepper.step(held)
    before = peak()
    for _ in range(20_000):
        stepper.step(held).sum()
    # In kilobytes; a frame that stayed would be 0.4 of them.
    assert peak() - before < 2000


def test_warnings_go_to_logging(caplog):
    with caplog.at_level(logging.WARNING, logger="selvedge"):
        selvedge.Scene.parse(
            """
name = "tight"
mesh.generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }
mesh.transform.material_scale = 0.5
handles.label = "upper-corners"
material = "gray-interlock"
motion.named = "forward"
"""
        )
    assert "material" in caplog.text


def test_steppers_say_what_is_to_be_known(small, model):
    assert selvedge.Simulator(small).warnings == []
    trained = selvedge.Model("paper")
    garment = pathlib.Path(__file__).parents[2] / "crates/selvedge/tests/fronts/garment.toml"
    stepper = selvedge.LearnedStepper(selvedge.Scene(str(garment)).with_motion("forward"), trained)
    said = "\n".join(stepper.warnings)
    assert "contact: this model does not see obstacles" in said


def test_what_is_no_snapshot_of_a_stepper_is_refused(small):
    one, rigid = selvedge.Simulator(small), selvedge.RigidStepper(small)
    before = one.step()
    with pytest.raises(selvedge.FrameError, match="another kind of stepper"):
        one.restore(rigid.snapshot())
    assert np.array_equal(one.positions, before)
    played = selvedge.PlaybackStepper(selvedge.simulate(small, frames=3))
    there = played.snapshot()
    played.step(np.zeros((2, 3)))
    played.restore(there)
    assert played.frame == 0 and played.warnings == []


def test_a_cloth_is_set_elsewhere_with_its_velocities(small):
    here, there = selvedge.Simulator(small), selvedge.Simulator(small)
    turn = np.array([[0, 0, 1, 2], [0, 1, 0, 0.5], [-1, 0, 0, -1], [0, 0, 0, 1]], float)
    moved = lambda points: points @ turn[:3, :3].T + turn[:3, 3]
    here.follow(12)
    there.follow(12)
    there.teleport(turn)
    assert np.allclose(there.state_positions(), moved(here.state_positions()), atol=1e-12)
    for _ in range(12):
        targets = here.next_targets()
        here.step(targets)
        there.step(moved(targets))
    assert np.abs(there.state_positions() - moved(here.state_positions())).max() < 1e-5
    with pytest.raises(selvedge.SelvedgeError, match="without scale"):
        there.teleport(2 * turn)
    with pytest.raises(selvedge.FrameError, match="only the solver can teleport"):
        selvedge.RigidStepper(small).teleport(turn)
