"""The notebook's cells run as a script, with few steps."""

import functools
import json
import pathlib

import pytest

import xavatar
from conftest import SETTINGS

NOTEBOOK = pathlib.Path(__file__).parents[1] / "notebooks" / "avatar.ipynb"


def test_the_notebook_runs(monkeypatch, capsys):
    pytest.importorskip("matplotlib").use("Agg")
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    assert all(cell.get("outputs", []) == [] for cell in cells), "outputs are not kept"
    script = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    assert "STEPS = 400" in script
    monkeypatch.setattr(xavatar, "train", functools.partial(xavatar.train, settings=SETTINGS))
    exec(compile(script.replace("STEPS = 400", "STEPS = 20"), str(NOTEBOOK), "exec"), {"__name__": "notebook"})
    printed = capsys.readouterr().out
    assert "follows" in printed and "mm mean distance" in printed
