"""What the tests share: the program beside the package, and a small data set."""

import os
import pathlib
import subprocess

import pytest
import selvedge


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """With SELVEDGE_ALL_TOOLS a test that lacks something fails."""
    report = yield
    if report.skipped and os.environ.get("SELVEDGE_ALL_TOOLS"):
        report.outcome = "failed"
        report.longrepr = f"{report.longrepr[2]}: run .ci/setup first"
    return report


ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def program():
    """Runs the program of the same sources; the environment names another one as SELVEDGE."""
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = pathlib.Path(os.environ.get("SELVEDGE", target / "debug" / "selvedge"))
    if not path.exists():
        pytest.skip(f"{path} is not there: build it with `cargo build`, or name one as SELVEDGE")

    def run(*arguments, **options):
        command = [path, "--quiet", *map(str, arguments)]
        return subprocess.run(command, check=True, capture_output=True, text=True, **options)

    return run


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """The data set `tiny`: squares of 36 vertices."""
    return selvedge.Dataset.generate("tiny", tmp_path_factory.mktemp("data") / "tiny")


@pytest.fixture(scope="session")
def scene():
    return selvedge.Scene("default")


@pytest.fixture(scope="session")
def small():
    """A scene of 36 vertices, which is at rest at once."""
    return selvedge.Scene.parse(
        """
name = "small"
mesh.generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }
handles.label = "upper-corners"
material = "gray-interlock"
motion.named = "forward"
"""
    )


@pytest.fixture(scope="session")
def model():
    return selvedge.Model("paper")
