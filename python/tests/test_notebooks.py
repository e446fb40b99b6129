"""The notebooks run from their first cell to their last."""

import pathlib

import pytest

NOTEBOOKS = sorted((pathlib.Path(__file__).resolve().parents[1] / "notebooks").glob("*.ipynb"))


def test_there_are_seven():
    assert len(NOTEBOOKS) == 7


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook(path, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not here")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not here")
    pytest.importorskip("ipykernel", reason="ipykernel is not here")
    notebook = nbformat.read(path, as_version=4)
    # They are kept without what they print.
    assert not any(cell.get("outputs") for cell in notebook.cells)
    client = nbclient.NotebookClient(
        notebook, timeout=180, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()
