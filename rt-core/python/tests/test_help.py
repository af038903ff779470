"""Help and types: everything public is explained, and typed as it is."""

import inspect
import pathlib
import subprocess
import sys

import force_by_tissue
import stylet


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


def test_the_example_draws_three_tissues(tmp_path, capsys):
    force_by_tissue.main(str(tmp_path / "force.png"))
    assert (tmp_path / "force.png").stat().st_size > 10_000
    said = capsys.readouterr().out
    assert all(tissue in said for tissue in stylet.tissues())
