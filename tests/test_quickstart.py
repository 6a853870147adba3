"""The notebook runs from its first cell to its last."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the length of the evolution, which `make evidence` runs whole."""
    client = pytest.importorskip("nbclient", reason="nbclient is not installed")
    nbformat = pytest.importorskip("nbformat")
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    text = (ROOT / "examples/quickstart.ipynb").read_text(encoding="utf-8")
    notebook = nbformat.reads(text.replace("generations=12", "generations=1"), as_version=4)
    client.NotebookClient(notebook, timeout=1200, resources={"metadata": {"path": str(tmp_path)}}).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    pictures = [output for cell in cells for output in cell.outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 5, "one picture for each step"
    assert "of 20 cross in the truth" in cells[-1].outputs[-1].text
    assert (tmp_path / "quickstart/run/champion.json").is_file()
