"""Python and the command line make the same bytes."""

import csv
import json
import pathlib
import threading
import time

import numpy as np
import pytest
import selvedge

SETTINGS = {"model.latent": 16, "model.blocks": 2, "statistics_samples": 20, "log_every": 1}


def test_a_simulation(program, small, tmp_path):
    scene = tmp_path / "small.toml"
    scene.write_text(
        """
name = "small"
mesh.generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }
handles.label = "upper-corners"
material = "gray-interlock"
motion.named = "forward"
"""
    )
    program("run", scene, "--frames", 40, "-o", tmp_path / "cli.safetensors")
    made = selvedge.simulate(selvedge.Scene(str(scene)), frames=40)
    assert made.to_bytes() == (tmp_path / "cli.safetensors").read_bytes()
    assert made.to_bytes() == selvedge.simulate(small, frames=40).to_bytes()


FRONTS = pathlib.Path(__file__).parents[2] / "crates/selvedge/tests/fronts"
# Those of crates/selvedge/tests/cli/fronts.rs.
RUNS = [
    ("substeps-1", None),
    ("substeps-3", None),
    ("substeps-8", None),
    ("garment", None),
    ("wind", None),
    ("let-go", None),
    ("substeps-3", "paper"),
    ("let-go", "paper"),
]


@pytest.mark.parametrize("name, by", RUNS)
def test_the_scenes_of_all_fronts(program, tmp_path, name, by):
    file = FRONTS / f"{name}.toml"
    scene = selvedge.Scene(str(file))
    out = tmp_path / "run.safetensors" if by is None else tmp_path / "run"
    model = [] if by is None else ["--model", by, "--no-clip"]
    program("run", file, *model, "--frames", 36, "-o", out)
    wanted = selvedge.Trajectory.read(out if by is None else out / "rollout.safetensors").positions
    if by is None:
        stepper, made = selvedge.Simulator(scene), selvedge.simulate(scene, frames=36)
    else:
        opened = selvedge.Model(by)
        stepper = selvedge.LearnedStepper(scene, opened)
        made = selvedge.rollout(scene, opened, frames=36).trajectory
    assert np.array_equal(made.positions, wanted)
    assert np.array_equal(stepper.follow(12), wanted[:13])
    there = stepper.snapshot()
    for frame in range(13, 37):
        assert np.array_equal(stepper.step(), wanted[frame])
    stepper.restore(there)
    assert np.array_equal(stepper.positions, wanted[12])
    assert np.array_equal(stepper.follow(24), wanted[12:])
    stepper.reset()
    assert np.array_equal(stepper.positions, wanted[0])


@pytest.mark.parametrize("name", ["paper"])
def test_a_rollout_with_its_truth_and_trust(program, scene, tmp_path, name):
    out = tmp_path / "cli"
    trust = tmp_path / "cli.csv"
    arguments = ["--model", name, "--frames", 25, "--no-clip", "--trust", trust, "-o", out]
    program("run", "default", "--compare", *arguments)
    made = selvedge.rollout(scene, selvedge.Model(name), frames=25, truth=True)
    assert made.trajectory.to_bytes() == (out / "rollout.safetensors").read_bytes()
    assert made.truth.to_bytes() == (out / "truth.safetensors").read_bytes()
    made.write_trust(tmp_path / "python.csv")
    assert (tmp_path / "python.csv").read_bytes() == trust.read_bytes()
    with trust.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows] == made.trust["verdict"]
    assert np.array_equal(
        [float(row["largest_strain"]) for row in rows], made.trust["largest_strain"]
    )
    assert made.comparison()["position_rmse"] > 0 and made.is_complete
    assert made.doubt is None


def test_a_data_set(program, data, tmp_path):
    program("data", "generate", "tiny", "-o", tmp_path / "tiny")
    folder = pathlib.Path(tmp_path / "tiny")
    assert json.loads((folder / "index.json").read_text()) == data.index
    for split in (data.train, data.test):
        for motion, trajectory in zip(split.motions, split):
            entries = data.index["splits"]["train"] + data.index["splits"]["test"]
            file = next(e["file"] for e in entries if e["motion"] == motion)
            assert (folder / file).read_bytes() == trajectory.to_bytes()


def trained(program, data, tmp_path):
    folder = tmp_path / "tiny"
    program("data", "generate", "tiny", "-o", folder)
    arguments = [x for k, v in SETTINGS.items() for x in ("--set", f"{k}={v}")]
    out = tmp_path / "cli"
    program("train", "first", "--data", folder, "--steps", 4, "-o", out, *arguments)
    return out


def test_a_training_and_an_evaluation(program, data, tmp_path):
    out = trained(program, data, tmp_path)
    heard = []
    report = selvedge.train(
        "first", data, out=tmp_path / "python", steps=4, settings=SETTINGS, on_step=heard.append
    )
    assert report["is_finished"] and [step["step"] for step in heard] == [1, 2, 3, 4]
    for file in ["model.safetensors", "log.jsonl", "config.toml"]:
        assert (tmp_path / "python" / file).read_bytes() == (out / file).read_bytes(), file
    log = [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]
    assert [line["loss"] for line in log] == [step["terms"]["total"] for step in heard]

    model = out / "model.safetensors"
    answer = program(
        "--json", "eval", "--model", f"m={model}", "--data", tmp_path / "tiny",
        "--horizons", "1,5", "-o", tmp_path / "report",
    )
    found = selvedge.evaluate({"m": selvedge.Model(model)}, [data], horizons=[1, 5])
    assert found.runs == json.loads(answer.stdout)["runs"]
    assert found.errors_csv().encode() == (tmp_path / "report" / "errors.csv").read_bytes()
    found.write_report(tmp_path / "own")
    # Times are those of each run.
    for name in ["errors.csv", "report.md"]:
        assert (tmp_path / "own" / name).read_bytes() == (tmp_path / "report" / name).read_bytes(), name
    assert {run["kind"] for run in found.runs} == {"model", "baseline"}
    assert found.means[0]["method"] == "m"


def test_a_training_that_is_stopped_goes_on_to_the_same_model(data, tmp_path):
    whole = {"steps": 6, "settings": SETTINGS}
    selvedge.train("first", data, out=tmp_path / "whole", **whole)
    stopped = selvedge.train(
        "first", data, out=tmp_path / "parts", on_step=lambda step: step["step"] < 3, **whole
    )
    assert stopped["steps_done"] == 3 and not stopped["is_finished"]
    with pytest.raises(ValueError, match="go on with it with resume=True"):
        selvedge.train("first", data, out=tmp_path / "parts", **whole)
    selvedge.train("first", data, out=tmp_path / "parts", resume=True, **whole)
    made = [tmp_path / name / "model.safetensors" for name in ("whole", "parts")]
    assert made[0].read_bytes() == made[1].read_bytes()


def test_what_a_callback_raises_is_raised(data, tmp_path):
    def fail(step):
        raise RuntimeError(f"step {step['step']}")

    with pytest.raises(RuntimeError, match="step 1"):
        selvedge.train("first", data, out=tmp_path / "run", steps=9, settings=SETTINGS, on_step=fail)
    assert (tmp_path / "run" / "checkpoint.safetensors").exists()


@pytest.mark.parametrize("what", ["simulate", "rollout", "train", "evaluate", "follow"])
def test_ctrl_c_ends_long_calls_within_a_second(what, scene, data, model, tmp_path):
    import signal

    scene.rest_pose()
    stepper = selvedge.Simulator(scene)
    calls = {
        "simulate": lambda: selvedge.simulate(scene, frames=100_000),
        "rollout": lambda: selvedge.rollout(scene, model, frames=100_000),
        "train": lambda: selvedge.train("first", data, out=tmp_path / "run", settings=SETTINGS),
        "evaluate": lambda: selvedge.evaluate({"m": model}, [data]),
        "follow": lambda: stepper.follow(100_000),
    }
    pressed = []

    def press():
        time.sleep(1.0)
        pressed.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    # A signal is handled by the main thread, which waits in the call.
    other = threading.Thread(target=press)
    other.start()
    with pytest.raises(KeyboardInterrupt):
        calls[what]()
        # An evaluation of this data set may be at its end before the key is pressed.
        other.join()
        time.sleep(0.1)
    other.join()
    assert time.monotonic() - pressed[0] < 1.0
