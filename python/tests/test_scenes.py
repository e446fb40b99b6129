"""Scenes, meshes, materials, trajectories and pictures."""

import copy

import numpy as np
import pytest
import selvedge


def test_scenes_are_opened_and_changed(scene):
    assert "default" in selvedge.Scene.names()
    assert scene.positions.shape == (400, 3) and not scene.positions.flags.writeable
    assert scene.positions.base is scene
    assert scene.faces.max() == 399
    denim = scene.with_material(selvedge.Material("11oz-black-denim"))
    assert denim.material.name == "11oz-black-denim" != scene.material.name
    assert denim.material.density == denim.to_dict()["setting"]["material"]["density"]
    other = scene.with_motion("side")
    assert not np.allclose(other.targets(300), scene.targets(300))
    with pytest.raises(selvedge.SelvedgeError, match="nope: is neither a file nor a shipped scene"):
        selvedge.Scene("nope")
    with pytest.raises(selvedge.SelvedgeError, match="motion.named"):
        scene.with_motion("dance")


def test_a_material_is_made_of_its_values():
    values = selvedge.Material("gray-interlock").to_dict()
    assert values["compression"] == {"half": 500.0, "third": 5000.0}
    soft = values | {"compression": {"half": 300.0, "third": 2000.0}}
    made = selvedge.Material.from_dict(soft)
    assert made.to_dict() == soft and copy.deepcopy(made).to_dict() == soft
    del values["compression"]
    assert selvedge.Material.from_dict(values).to_dict()["compression"]["half"] == 500.0
    numbers = {key: np.array(value) for key, value in values.items() if key in ("stretch", "bend")}
    numbers["density"] = np.float32(0.25)
    assert selvedge.Material.from_dict(soft | numbers).to_dict() == soft | {"density": 0.25}
    with pytest.raises(selvedge.SelvedgeError, match="compression.third must be .* more than 1.5"):
        selvedge.Material.from_dict(values | {"compression": {"half": 300.0, "third": 400.0}})


def test_paths_are_taken_wherever_names_are(tmp_path, scene):
    fabric = 'from = "gray-interlock"\nname = "own"\ndensity = 0.3\n'
    (tmp_path / "own.toml").write_text(fabric)
    assert selvedge.Material(tmp_path / "own.toml").density == 0.3
    (tmp_path / "scene.toml").write_text(
        'name = "own"\nmaterial = "own.toml"\nstart = "mesh"\n'
        'mesh.generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }\n'
        'handles.label = "upper-corners"\n'
    )
    assert selvedge.Scene(tmp_path / "scene.toml").material.name == "own"
    with pytest.raises(selvedge.SelvedgeError, match="nope"):
        scene.with_motion(tmp_path / "nope.toml")
    with pytest.raises(selvedge.SelvedgeError, match="nope"):
        selvedge.Dataset.generate(tmp_path / "nope.toml", tmp_path / "data")


def test_a_motion_may_be_an_array(small):
    start = small.positions[small.handles]
    targets = start + np.linspace(0, 0.05, 11)[:, None, None] * np.array([1.0, 0, 0])
    moved = small.with_targets(targets)
    assert moved.frames == 10
    run = selvedge.simulate(moved)
    assert len(run) == 11
    assert np.abs(run.positions[-1][small.handles] - targets[-1]).max() < 1e-6
    with pytest.raises(ValueError, match=r"must have the shape \(frames, 2, 3\)"):
        small.with_targets(targets[:, :1])


def test_a_mesh_may_be_arrays(small):
    side = np.linspace(0, 0.5, 6)
    z, y = np.meshgrid(side, side)
    points = np.stack([0 * z.ravel(), y.ravel() - 0.5, z.ravel()], axis=1)
    corner = np.array([[6 * j + i for i in range(5)] for j in range(5)]).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 7], 1), np.stack([corner, corner + 7, corner + 6], 1)]
    )
    mesh = selvedge.Mesh(points, faces)
    scene = small.with_mesh(mesh, handles=[30, 35])
    assert scene.to_dict() is None
    run = selvedge.simulate(scene, frames=5)
    assert run.scene is None and np.isfinite(run.positions).all()
    assert np.isclose(run.masses.sum(), 0.25 * scene.material.density, rtol=1e-5)
    bent = points.copy()
    bent[3, 0] = 0.1
    with pytest.raises(ValueError, match="positions must be finite, and those of vertex 2 are not"):
        selvedge.Mesh([[0, 0, 0], [0, 1, 0], [0, 0, np.nan]], [[0, 1, 2]])
    with pytest.raises(ValueError, match="material is missing: vertex 3"):
        selvedge.Mesh(bent, faces)
    with pytest.raises(ValueError, match="numbers of vertices"):
        selvedge.Mesh(points, faces - 1.0)
    with pytest.raises(selvedge.SelvedgeError):
        selvedge.Mesh(points, faces + 30)


def test_generated_meshes_have_labels():
    mesh = selvedge.Mesh.generate("triangle", vertices=80)
    assert mesh.positions.shape == (80, 3) and "boundary" in mesh.labels
    with pytest.raises(selvedge.SelvedgeError, match="unknown variant"):
        selvedge.Mesh.generate("hexagon")


def test_trajectories_share_their_memory_and_come_back(small, tmp_path):
    run = selvedge.simulate(small, frames=8)
    positions = run.positions
    assert positions.base is run and not positions.flags.writeable
    assert np.shares_memory(positions, run.positions)
    run.write(tmp_path / "run.safetensors")
    again = selvedge.Trajectory.read(tmp_path / "run.safetensors")
    assert again.to_bytes() == run.to_bytes()
    del run
    assert np.array_equal(positions, again.positions)
    assert again.compare(again)["position_rmse"] == 0.0
    other = selvedge.simulate(selvedge.Scene("default"), frames=1)
    with pytest.raises(selvedge.SelvedgeError, match="36 and 400 vertices"):
        again.compare(other)


def test_pictures_are_shown_inline(small, tmp_path):
    run = selvedge.simulate(small, frames=30)
    for picture in [run.picture(), run.picture(0, size=(200, 100)), run.sheet(), run.strain_sheet()]:
        assert picture._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    assert run._repr_png_() == run.sheet().png
    run.picture().save(tmp_path / "last.png")
    assert (tmp_path / "last.png").read_bytes() == run.picture(-1).png
    run.clip(tmp_path / "run.gif")
    assert (tmp_path / "run.gif").read_bytes()[:6] == b"GIF89a"
    with pytest.raises(selvedge.SelvedgeError, match="frame 31|only 31 frames"):
        run.picture(31)


def test_exports_are_those_of_other_programs(small, tmp_path):
    run = selvedge.simulate(small, frames=6)
    for ending in ["usdc", "usdz", "abc", "glb", "pc2", "npz"]:
        name = f"run.{ending}"
        run.export(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 500
    with np.load(tmp_path / "run.npz") as arrays:
        assert np.array_equal(arrays["positions"], run.positions)
    run.export(tmp_path / "some.npz", frames="2..4", every=2)
    with np.load(tmp_path / "some.npz") as arrays:
        assert np.array_equal(arrays["positions"], run.positions[2:5:2])
    with pytest.raises(ValueError, match="the name must end in"):
        run.export(tmp_path / "run.xyz")


def test_files_say_what_they_are(small, data, model, tmp_path):
    run = selvedge.simulate(small, frames=3)
    run.write(tmp_path / "run.safetensors")
    model.write(tmp_path / "model.safetensors")
    assert selvedge.inspect(tmp_path / "run.safetensors")["frames"] == 4
    assert selvedge.inspect(tmp_path / "model.safetensors")["parameters"] == model.parameters
    (tmp_path / "broken.safetensors").write_bytes(b"no")
    with pytest.raises(selvedge.SelvedgeError, match="broken.safetensors"):
        selvedge.inspect(tmp_path / "broken.safetensors")
