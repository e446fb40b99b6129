"""Scenes, meshes, models, data sets and trajectories are copied and go to other processes."""

import concurrent.futures
import copy
import multiprocessing
import pickle

import numpy as np
import pytest
import selvedge


def again(thing):
    return pickle.loads(pickle.dumps(thing))


@pytest.mark.parametrize("name", ["default", "tablecloth"])
def test_a_scene_is_the_same_scene(name):
    scene = selvedge.Scene(name).with_material(selvedge.Material("11oz-black-denim"))
    for other in (again(scene), copy.deepcopy(scene)):
        assert other.to_dict() == scene.to_dict()
        assert np.array_equal(other.positions, scene.positions)
        assert np.array_equal(other.targets(30), scene.targets(30))


def test_a_scene_with_files_is_found_from_another_folder(tmp_path, monkeypatch):
    points = ["v 0 0 0", "v 0 0 1", "v 0 1 1", "v 0 1 0", "f 1 2 3 4"]
    (tmp_path / "sheet.obj").write_text("\n".join(points))
    (tmp_path / "scene.toml").write_text(
        'name = "own"\nmaterial = "gray-interlock"\nmesh = { file = "sheet.obj" }\n'
        'start = "mesh"\nhandles = { vertices = [2, 3] }\n'
    )
    monkeypatch.chdir(tmp_path)
    bytes_ = [pickle.dumps(selvedge.Scene(path)) for path in ["scene.toml", tmp_path / "scene.toml"]]
    monkeypatch.chdir("/")
    for scene in map(pickle.loads, bytes_):
        assert scene.name == "own" and len(scene.positions) == 4


def test_a_mesh_and_a_scene_of_it(small):
    mesh = selvedge.Mesh.generate("disc", vertices=60, size=0.5)
    assert np.array_equal(again(mesh).positions, mesh.positions)
    arrays = selvedge.Mesh(mesh.positions, mesh.faces)
    assert np.array_equal(again(arrays).faces, arrays.faces)
    still = selvedge.Scene.parse(
        'name = "still"\nmaterial = "gray-interlock"\nstart = "mesh"\n'
        'mesh.generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }\n'
        'handles.label = "upper-corners"\n'
    )
    scene = still.with_mesh(mesh, [0, 5])
    other = again(scene)
    assert other.to_dict() is None
    assert np.array_equal(other.positions, mesh.positions)
    assert list(other.handles) == [0, 5]


def test_models_data_sets_and_trajectories(model, data, small):
    assert again(model).to_bytes() == model.to_bytes()
    assert again(model).name == model.name
    assert again(data).index == data.index
    assert again(data.test).motions == data.test.motions
    run = selvedge.simulate(small, frames=3)
    assert again(run).to_bytes() == run.to_bytes()
    fabric = selvedge.Material("gray-interlock")
    assert again(fabric).to_dict() == fabric.to_dict()


def vertices_of(scene, model, data):
    return len(scene.positions), model.parameters, len(data.train)


def test_they_go_to_a_process_that_was_spawned(small, model, data):
    spawned = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=spawned) as pool:
        found = pool.submit(vertices_of, small, model, data).result(timeout=120)
    assert found == vertices_of(small, model, data)


def steppers(scene, model):
    run = selvedge.simulate(scene, frames=12)
    return [
        selvedge.Simulator(scene),
        selvedge.LearnedStepper(scene, model),
        selvedge.PlaybackStepper(run),
        selvedge.RigidStepper(scene),
    ]


def test_steppers_are_copied_with_their_state(small, model):
    for stepper in steppers(small, model):
        targets = small.positions[small.handles] + [0.0, 0.01, 0.0]
        stepper.step(targets)
        for other in (copy.copy(stepper), copy.deepcopy(stepper)):
            assert type(other) is type(stepper) and other.frame == 1
            before = stepper.snapshot()
            assert np.array_equal(other.step(targets), stepper.step(targets))
            stepper.restore(before)
        other.reset()
        stepper.reset()
        assert np.array_equal(other.positions, stepper.positions) and other.frame == 0


def test_a_simulator_goes_on_elsewhere(small, model):
    stepper = selvedge.Simulator(small)
    stepper.follow(7)
    other = again(stepper)
    assert other.frame == 7
    assert np.array_equal(other.follow(5), stepper.follow(5))
    for other in steppers(small, model)[1:]:
        with pytest.raises(TypeError, match="is not pickled: pickle the scene"):
            pickle.dumps(other)
