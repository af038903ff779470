"""Help and types: everything public is explained, and typed as it is."""

import inspect
import json
import pathlib
import subprocess
import sys

import stylet
from conftest import ROOT


def public():
    for name in stylet.__all__:
        thing = getattr(stylet, name)
        if not name.startswith("_"):
            yield name, thing
        if inspect.isclass(thing):
            yield from ((f"{name}.{key}", value) for key, value in vars(thing).items() if not key.startswith("_"))


def test_everything_has_help():
    found = dict(public())
    assert len(found) > 60
    assert [name for name, thing in found.items() if not (thing.__doc__ or "").strip()] == []
    assert "stylet.Stage(scene)" in stylet.__doc__


def test_types_are_those_of_the_module():
    assert (pathlib.Path(stylet.__file__).parent / "py.typed").exists()
    for check in (["mypy.stubtest", "stylet._stylet", "--ignore-disjoint-bases"], ["mypy", "--strict", "-p", "stylet"]):
        run = subprocess.run([sys.executable, "-m", *check], capture_output=True, text=True)
        assert run.returncode == 0, run.stdout + run.stderr


def test_notebooks_are_stored_without_outputs():
    notebooks = list((ROOT / "rt-core/python/examples").glob("*.ipynb"))
    assert len(notebooks) == 5
    for path in notebooks:
        cells = json.loads(path.read_text())["cells"]
        assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == [], path.name
