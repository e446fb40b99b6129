"""Trajectories of arrays of one's own, and data sets of trajectories."""

import numpy as np
import pytest
import selvedge

FACES = [[0, 1, 2], [0, 2, 3]]
MATERIAL = [[0, 0], [1, 0], [1, 1], [0, 1]]


def positions(frames=4):
    flat = np.array([[0, y - 1, x] for x, y in MATERIAL], float)
    return np.stack([flat + [0.01 * frame, 0, 0] for frame in range(frames)])


def made(**options):
    return selvedge.Trajectory(positions(), FACES, MATERIAL, [3, 2], 30.0, **{"density": 0.2} | options)


def test_arrays_become_a_trajectory(tmp_path):
    run = made()
    np.testing.assert_array_equal(run.positions, positions().astype(np.float32))
    assert run.frame_rate == 30 and run.handles.tolist() == [3, 2] and len(run) == 4
    assert abs(run.masses.sum() - 0.2) < 1e-6
    run.write(tmp_path / "run.safetensors")
    again = selvedge.Trajectory.read(tmp_path / "run.safetensors")
    np.testing.assert_array_equal(again.positions, run.positions)
    np.testing.assert_array_equal(again.rest_positions, positions()[0].astype(np.float32))


def test_masses_and_areas_may_be_given():
    run = made(density=None, masses=[0.1] * 4, areas=[0.5, 0.5])
    np.testing.assert_array_equal(run.masses, np.full(4, 0.1, np.float32))
    for options in [{"density": None}, {"masses": [0.1] * 4}]:
        with pytest.raises(ValueError, match="either density, or masses and areas"):
            made(**options)


def test_what_does_not_fit_is_named():
    with pytest.raises(ValueError, match=r"shape \(frames, 4, 3\), found \[2, 3, 3\]"):
        selvedge.Trajectory(np.zeros((2, 3, 3)), FACES, MATERIAL, [3], 30.0, density=0.2)
    with pytest.raises(selvedge.SelvedgeError, match="face 1 names vertex 9"):
        selvedge.Trajectory(positions(), [[0, 1, 2], [0, 2, 9]], MATERIAL, [3], 30.0, density=0.2)


def test_trajectories_become_a_data_set(tmp_path):
    data = selvedge.Dataset.write(
        tmp_path / "set", "squares", ["a"], ["b"], lambda split, name: made(density=0.2 if name == "a" else 0.3)
    )
    assert data.name == "squares" and len(data.train) == len(data.test) == 1
    assert abs(data.test["b"].masses.sum() - 0.3) < 1e-6

    def fail(split, name):
        raise KeyError("no such file")

    with pytest.raises(KeyError, match="no such file"):
        selvedge.Dataset.write(tmp_path / "other", "x", ["a"], [], fail)


def test_only_a_drape_test_has_the_measures_of_one():
    assert made().drape() is None
    flat = selvedge.Scene("drape")
    run = selvedge.Trajectory(
        np.stack([flat.positions] * 2),
        flat.faces,
        flat.positions[:, [2, 0]],
        flat.handles.tolist(),
        60.0,
        density=0.2,
    )
    measures = run.drape()
    assert measures["coefficient"] > 0.98 and measures["nodes"] == 0 and len(measures["profile"]) == 72
