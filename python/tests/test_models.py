"""Models as state dicts, data sets as sequences, the environment, and PyTorch where it is there."""

import importlib
import importlib.util
import pathlib
import sys
import types

import numpy as np
import pytest
import selvedge


def test_a_model_goes_to_a_state_dict_and_back(model):
    state = model.state_dict()
    assert sum(x.size for k, x in state.items() if not k.startswith("normalizer.")) == model.parameters
    assert all(not x.flags.writeable for x in state.values())
    assert state["decoder.4.weight"].base is model
    again = selvedge.Model.from_state_dict(model.spec, state, training=model.training)
    assert again.to_bytes() == model.to_bytes()
    halved = {name: values / 2 for name, values in state.items()}
    assert selvedge.Model.from_state_dict(model.spec, halved).to_bytes() != model.to_bytes()


def test_a_state_dict_that_does_not_fit_is_refused(model):
    state = dict(model.state_dict())
    weight = state.pop("decoder.4.weight")
    with pytest.raises(ValueError, match="decoder.4.weight is missing"):
        selvedge.Model.from_state_dict(model.spec, state)
    with pytest.raises(ValueError, match="decoder.4.weight must have the shape"):
        selvedge.Model.from_state_dict(model.spec, state | {"decoder.4.weight": weight.T})
    with pytest.raises(ValueError, match="more is in the state dict"):
        selvedge.Model.from_state_dict(model.spec, model.state_dict() | {"more": weight})
    broken = weight.copy()
    broken[0, 0] = np.nan
    with pytest.raises(selvedge.SelvedgeError, match=r"decoder.4.weight\[0\] is not finite"):
        selvedge.Model.from_state_dict(model.spec, state | {"decoder.4.weight": broken})
    with pytest.raises(selvedge.SelvedgeError, match="no shipped model of this name"):
        selvedge.Model("nope")


def test_a_data_set_is_a_sequence_of_trajectories(data, tmp_path):
    assert len(data.train) == len(data.train.motions) > 0
    first = data.train[0]
    assert np.array_equal(data.train[data.train.motions[0]].positions, first.positions)
    assert np.array_equal(data.train[-1].positions, list(data.train)[-1].positions)
    with pytest.raises(IndexError):
        data.train[len(data.train)]
    with pytest.raises(KeyError, match="there are"):
        data.test["nope"]
    samples = data.samples
    assert samples.shape == (data.index["statistics"]["samples"], 2)
    assert (samples[:, 1] >= 1).all()
    with pytest.raises(selvedge.SelvedgeError, match="nope"):
        selvedge.Dataset(tmp_path / "nope")


def test_a_training_starts_from_a_model_and_a_folder(data, tmp_path):
    """The model itself, its file, or the folder of its training; data by their folder."""
    settings = {"model.latent": 8, "model.blocks": 1, "statistics_samples": 20}
    folder = tmp_path / "data"
    selvedge.Dataset.generate("tiny", folder)
    ends = {"steps": 1, "settings": settings}
    first = selvedge.train("first", folder, tmp_path / "one", **ends)
    starts = [selvedge.Model(first["model"]), first["model"], tmp_path / "one"]
    made = [selvedge.train("first", folder, tmp_path / str(k), start_from=start, **ends) for k, start in enumerate(starts)]
    bytes_ = {selvedge.Model(report["model"]).to_bytes() for report in made}
    assert len(bytes_) == 1
    found = selvedge.evaluate({"one": starts[0]}, [folder], horizons=[1], starts=1)
    assert found.runs


def test_the_environment_reaches_a_pose(small):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    from selvedge import gym

    env = gym.ReachPose(small, frames=360, tolerance=0.03)
    check_env(env, skip_render_check=True)
    first, _ = env.reset(seed=4)
    again, info = env.reset(seed=4)
    assert np.array_equal(first["goal"], again["goal"])
    start = info["distance"]
    # The handles go where they are in the goal: a policy that anyone can write.
    done = cut = False
    observation = again
    while not (done or cut):
        missing = observation["goal"][small.handles] - observation["handles"]
        observation, reward, done, cut, info = env.step(missing / env._step_length)
    assert done and info["distance"] < 0.03 < start
    made = gymnasium.make("selvedge/ReachPose-v0", scene=small)
    assert made.observation_space["positions"].shape == (36, 3)


def test_worlds_side_by_side_go_as_each_alone(small):
    gymnasium = pytest.importorskip("gymnasium")
    from selvedge import gym

    count, options = 3, {"scene": small, "frames": 4}
    worlds = gymnasium.make_vec("selvedge/ReachPose-v0", num_envs=count, **options)
    assert isinstance(worlds.unwrapped, gym.ReachPoses)
    alone = [gym.ReachPose(**options) for _ in range(count)]
    observed, _ = worlds.reset(seed=7)
    expected = [env.reset(seed=7 + k)[0] for k, env in enumerate(alone)]
    actions = np.random.default_rng(1)
    for step in range(7):
        for key in observed:
            assert observed[key].shape[0] == count
            assert np.array_equal(observed[key], np.stack([one[key] for one in expected]))
        assert worlds.observation_space.contains(observed)
        action = actions.uniform(-1, 1, (count, 2, 3)).astype(np.float32)
        observed, rewards, terminated, truncated, infos = worlds.step(action)
        if step == 4:
            # The episodes were cut off in the step before.
            expected = [env.reset()[0] for env in alone]
            assert (rewards == 0).all() and (infos["frame"] == 0).all()
            continue
        made = [env.step(one) for env, one in zip(alone, action)]
        expected = [one[0] for one in made]
        assert list(rewards) == [one[1] for one in made] and not terminated.any()
        assert truncated.all() == (step == 3)
    worlds.close()


def test_an_episode_in_which_the_cloth_is_torn_ends_with_a_reason(small):
    pytest.importorskip("gymnasium")
    from selvedge import gym

    env = gym.ReachPose(small, frames=240)
    env.reset(seed=4)
    # The two corners run apart for as long as there are frames.
    apart = np.zeros(env.action_space.shape, np.float32)
    apart[0, 2], apart[1, 2] = (1, -1) if small.positions[small.handles[0], 2] > 0.5 else (-1, 1)
    done = cut = False
    while not (done or cut):
        observation, reward, done, cut, info = env.step(apart)
    assert done and not cut and "strain" in info["reason"]
    assert np.isfinite(reward) and reward < -info["distance"]
    assert env.observation_space.contains(observation)
    _, info = env.reset(seed=4)
    assert "reason" not in info


def test_the_environment_draws_itself(small):
    pytest.importorskip("gymnasium")
    pytest.importorskip("matplotlib")
    from selvedge import gym

    env = gym.ReachPose(small, render_mode="rgb_array")
    env.reset(seed=1)
    assert env.render().shape == (400, 400, 3)


def test_pytorch_sees_windows(data):
    torch = pytest.importorskip("torch", reason="PyTorch is not here")
    from selvedge.torch import Windows

    windows = Windows(data, history=3)
    batch = next(iter(torch.utils.data.DataLoader(windows, batch_size=4, shuffle=True)))
    assert batch["positions"].shape == (4, 3, 36, 3)
    sample = windows[10]
    positions = data.train[sample["trajectory"]].positions
    assert np.array_equal(sample["target"].numpy(), positions[sample["frame"] + 1])


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_workers_of_a_loader_read_windows(data, context):
    torch = pytest.importorskip("torch", reason="PyTorch is not here")
    from selvedge.torch import Windows

    windows = Windows(data, history=2, split="test")
    loader = torch.utils.data.DataLoader(windows, batch_size=8, num_workers=1, multiprocessing_context=context, timeout=60)
    read = [frame for batch in loader for frame in batch["frame"].tolist()]
    assert read == windows.samples[:, 1].tolist()


def test_windows_of_the_test_split_are_all_its_frames(data):
    torch = pytest.importorskip("torch", reason="PyTorch is not here")
    from selvedge.torch import Windows

    windows = Windows(data, split="test")
    assert len(windows) == sum(len(run) - 2 for run in data.test)
    last = windows[-1]
    assert np.array_equal(last["target"].numpy(), data.test[-1].positions[-1])
    cloth = windows.cloth(0)
    assert np.array_equal(cloth["edges"].numpy(), data.test[0].edges)
    assert np.array_equal(torch.nonzero(cloth["held"]).flatten().numpy(), sorted(data.test[0].handles))
    with pytest.raises(ValueError, match="train or test"):
        Windows(data, split="tests")


def test_a_network_of_ones_own_learns_from_windows(data):
    """The example `mesh_graph_net.py`."""
    pytest.importorskip("torch", reason="PyTorch is not here")
    path = pathlib.Path(__file__).resolve().parents[1] / "examples" / "mesh_graph_net.py"
    spec = importlib.util.spec_from_file_location("mesh_graph_net", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    _, losses = example.train(data, steps=150)
    assert np.mean(losses[-50:]) < np.mean(losses[:50])


def test_windows_end_with_the_current_frame(data, monkeypatch):
    """The same with a stand-in for PyTorch, which may not be here."""
    stand_in = types.ModuleType("torch")
    stand_in.utils = types.SimpleNamespace(data=types.SimpleNamespace(Dataset=object))
    stand_in.from_numpy = lambda array: array
    monkeypatch.setitem(sys.modules, "torch", stand_in)
    monkeypatch.delitem(sys.modules, "selvedge.torch", raising=False)
    windows = importlib.import_module("selvedge.torch").Windows(data, history=4)
    monkeypatch.delitem(sys.modules, "selvedge.torch", raising=False)
    assert len(windows) == len(data.samples)
    for number in [0, len(windows) - 1]:
        trajectory, frame = data.samples[number]
        positions = data.train[int(trajectory)].positions
        item = windows[number]
        frames = [max(0, int(frame) - back) for back in (3, 2, 1, 0)]
        assert np.array_equal(item["positions"], positions[frames])
        assert np.array_equal(item["target"], positions[frame + 1])
        assert (item["trajectory"], item["frame"]) == (trajectory, frame)
        assert item["positions"].flags.writeable and item["target"].flags.writeable
    with pytest.raises(ValueError, match="history must be at least 1"):
        type(windows)(data, history=0)


def test_pytorch_gives_and_takes_a_state_dict(model):
    torch = pytest.importorskip("torch", reason="PyTorch is not here")
    state = {name: torch.from_numpy(values.copy()) for name, values in model.state_dict().items()}
    again = selvedge.Model.from_state_dict(model.spec, state, training=model.training)
    assert again.to_bytes() == model.to_bytes()
