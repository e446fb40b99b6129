"""Gradients of the solver: shapes, errors, slopes, and PyTorch's function of the example."""

import importlib.util
import pathlib

import numpy as np
import pytest
import selvedge


@pytest.fixture(scope="module")
def swung():
    return selvedge.Scene.parse(
        """
name = "swung"
mesh.generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }
handles.label = "upper-corners"
material = "gray-interlock"
physics.solver = "cholesky"
environment.wind = [1.0, 0.2, -0.5]
"""
    )


def start_of(scene):
    rng = np.random.default_rng(1)
    return 0.98 * np.array(scene.positions) + 0.004 * rng.standard_normal(scene.positions.shape)


def run(scene, start, frames=6, record=True):
    cloth = selvedge.Simulator(scene, start)
    if record:
        cloth.record_gradient()
    made = [cloth.state_positions()]
    for frame in range(frames):
        cloth.step(start[scene.handles] + [0.01 * frame, 0, 0])
        made.append(cloth.state_positions())
    return cloth, np.stack(made)


def test_slopes_are_those_of_differences(swung):
    start = start_of(swung)
    weights = np.random.default_rng(2).standard_normal((7, 36, 3))
    cloth, _ = run(swung, start)
    found = cloth.backward(positions=weights)
    assert found["targets"].shape == (6, 1, 2, 3)
    fabric = found["materials"][0]
    assert fabric["stretch"].shape == (6, 4) and fabric["bend"].shape == (3, 5)
    # Nothing depends on where in the plane the pattern lies.
    by_points = found["pattern"]
    assert by_points.shape == (36, 2) and np.abs(by_points).max() > 0
    assert np.abs(by_points.sum(axis=0)).max() < 1e-9 * np.abs(by_points).max()

    def value(density):
        values = swung.material.to_dict() | {"density": density}
        scene = swung.with_material(selvedge.Material.from_dict(values))
        return (run(scene, start, record=False)[1] * weights).sum()

    density, step = swung.material.density, 1e-6
    slope = (value(density + step) - value(density - step)) / (2 * step)
    assert abs(fabric["density"] / slope - 1) < 1e-6


def test_what_has_no_gradient_says_why(swung):
    cloth = selvedge.Simulator(swung, start_of(swung))
    with pytest.raises(selvedge.SelvedgeError, match="nothing is recorded"):
        cloth.backward()
    cloth.record_gradient()
    with pytest.raises(ValueError, match=r"\(1, 36, 3\)"):
        cloth.backward(positions=np.zeros((3, 36, 3)))
    seed = np.zeros((1, 36, 3))
    seed[0, 7, 1] = np.nan
    with pytest.raises(ValueError, match="frame 0: .*given for velocity 7 are not finite"):
        cloth.backward(velocities=seed)
    cloth.teleport(np.eye(4))
    with pytest.raises(selvedge.SelvedgeError, match="for `teleport` ended the recording"):
        cloth.backward()


def test_the_order_of_an_array_in_memory_does_not_matter(swung):
    cloth, _ = run(swung, start_of(swung))
    by = np.random.default_rng(2).standard_normal((7, 36, 3))
    found, turned = cloth.backward(positions=by), cloth.backward(positions=np.asfortranarray(by))
    assert np.array_equal(found["positions"], turned["positions"])
    start = start_of(swung)
    other, _ = run(swung, np.asfortranarray(start))
    assert np.array_equal(other.state_positions(), cloth.state_positions())


def test_bodies_and_samples_that_cannot_be_are_refused(swung):
    cloth = selvedge.Simulator(swung, start_of(swung))
    with pytest.raises(ValueError, match="there is no obstacle 9: 0 can be led"):
        cloth.lead_body(9, np.eye(4))
    with pytest.raises(ValueError, match="there is no obstacle 9: 0 can be led"):
        cloth.teleport(np.eye(4), [9])
    with pytest.raises(ValueError, match="found -1") as refused:
        cloth.lead_body(-1, np.eye(4))
    assert any("'body'" in note for note in refused.value.__notes__)
    with pytest.raises(ValueError, match=r"shape \(4, 4\), found \[16\]"):
        cloth.teleport(np.eye(4).ravel())
    aside = np.eye(4)
    aside[0, 3] = 1.0
    with pytest.raises(selvedge.SelvedgeError, match="the last column|found its transpose"):
        cloth.teleport(aside.T)
    cloth.teleport(aside)
    with pytest.raises(ValueError, match="at most 65536"):
        swung.targets(0, 2**26)


def test_contact_has_gradients_by_the_body_too():
    text = """
name = "on a ball"
mesh.generator = { kind = "square", vertices = 36, size = 0.4, seed = 1 }
mesh.transform = { rotation = { axis = [0, 0, 1], angle_deg = 90 }, translation = [-0.2, 0.005, 0] }
handles = { vertices = [] }
material = "gray-interlock"
contact = {}
physics.solver = "cholesky"
obstacles = [
    { name = "ball", sphere = { radius = 0.15 }, transform = { translation = [0.01, %.17g, 0.02] } },
]
"""

    def run(height):
        scene = selvedge.Scene.parse(text % height)
        cloth = selvedge.Simulator(scene, scene.positions)
        cloth.record_gradient()
        for _ in range(10):
            cloth.step()
        return cloth, cloth.state_positions()[:, 0].sum()

    height, step = -0.16, 1e-8
    cloth, _ = run(height)
    by = np.zeros((11, 36, 3))
    by[-1, :, 0] = 1.0
    gradient = cloth.backward(positions=by)
    assert gradient["obstacles"].shape == (11, 1, 2, 3)
    found = gradient["obstacles"][:, 0, 0, 1].sum()
    slope = (run(height + step)[1] - run(height - step)[1]) / (2 * step)
    assert abs(found) > 1e-3 and abs(found / slope - 1) < 1e-5


def test_a_fabric_is_found_from_markers():
    torch = pytest.importorskip("torch")
    path = pathlib.Path(__file__).resolve().parents[1] / "examples" / "differentiable_cloth.py"
    spec = importlib.util.spec_from_file_location("differentiable_cloth", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    scene = selvedge.Scene.parse(
        """
name = "marked"
mesh.generator = { kind = "square", vertices = 25, size = 1.0, seed = 1 }
handles.label = "upper-corners"
material = "gray-interlock"
physics.solver = "cholesky"
"""
    )
    targets = example.swing(scene, 3)
    start = torch.tensor(start_of(scene), requires_grad=True)
    targets.requires_grad_()
    function = lambda start, targets: example.simulate(scene, targets, start=start)[-1]
    assert torch.autograd.gradcheck(function, (start, targets), eps=1e-6, atol=1e-5, rtol=1e-4)
    with torch.no_grad():
        targets = example.swing(scene, 40)
        seen = example.simulate(scene, targets)[:, 5:25]
    factors, error, _ = example.fit(scene, targets, list(range(5, 25)), seen, steps=30)
    assert error < 1e-2 and torch.allclose(factors, torch.ones(3, dtype=torch.float64), atol=0.05)
