"""The scripts of assets/datasets write presets that the program reads with all their cloths and motions."""

import importlib
import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest
import selvedge

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "assets" / "datasets"


@pytest.mark.parametrize(
    ("script", "options", "cloths"),
    [("any", ["--cloths", "24"], 24), ("broad", ["--density", "100"], 50), ("broad", ["--few"], 0)],
)
def test_a_preset_that_a_script_writes_is_read_whole(program, tmp_path, script, options, cloths):
    folder = tmp_path / "preset"
    subprocess.run([sys.executable, SCRIPTS / f"{script}.py", folder, *options], check=True)
    (preset,) = folder.glob("*.toml")
    found = json.loads(program("info", "--json", preset).stdout)
    assert found["name"] == preset.stem
    assert len(found["config"].get("cloths", [])) == cloths
    assert found["samples"] > 1000


def test_the_fabrics_of_any_are_those_that_ship(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPTS)
    script = importlib.import_module("any")
    files = list(script.MATERIALS.glob("*.toml"))
    assert {file.stem for file in files} == set(selvedge.Material.names())
    for file in files:
        read, fabric = script.tables(file), selvedge.Material(file.stem).to_dict()
        for key in ("density", "stretch", "bend"):
            assert np.allclose(read[key], fabric[key], rtol=1e-12), (file.stem, key)
