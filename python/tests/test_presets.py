"""The scripts of assets/datasets write presets that the program reads with all their cloths and motions."""

import importlib
import json
import pathlib
import subprocess
import sys
import tomllib

import numpy as np
import pytest
import selvedge

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "assets" / "datasets"


@pytest.mark.parametrize(
    ("script", "options", "cloths"),
    [("any", ["--cloths", "20", "--bodies", "4"], 24), ("broad", ["--density", "100"], 50), ("broad", ["--few"], 0)],
)
def test_a_preset_that_a_script_writes_is_read_whole(program, tmp_path, script, options, cloths):
    folder = tmp_path / "preset"
    subprocess.run([sys.executable, SCRIPTS / f"{script}.py", folder, *options], check=True)
    (preset,) = folder.glob("*.toml")
    found = json.loads(program("info", "--json", preset).stdout)
    assert found["name"] == preset.stem
    assert len(found["config"].get("cloths", [])) == cloths
    assert found["samples"] > 1000


def test_the_fabrics_that_any_mixes_are_whole_tables_of_ones_that_ship(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPTS)
    script = importlib.import_module("any")
    assert len(set(script.FABRICS) & set(selvedge.Material.names())) == 4
    for name in script.FABRICS:
        read = tomllib.loads((script.MATERIALS / f"{name}.toml").read_text())
        fabric = selvedge.Material(name).to_dict()
        for key in ("density", "stretch", "bend"):
            assert np.allclose(read[key], fabric[key], rtol=1e-12), (name, key)
