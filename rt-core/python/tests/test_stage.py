"""Rehearsals and studies: the bits of the programs."""

import os
import pathlib
import subprocess
import tomllib

import numpy as np
import pytest
import stylet
from conftest import AXIS, ENTRY_MM, ROOT, same_bits

STUDY = """
name = "few"
implants = 1
linear = true
[[gland]]
scene = "paper"
plan = "plan.toml"
[vary]
"""


@pytest.fixture
def study(tmp_path):
    """A study of the first four needles of a plan of the programs."""
    head, *needles = (ROOT / "docs/study/paper-plan.toml").read_text().split("[[needle]]")
    (tmp_path / "plan.toml").write_text("[[needle]]".join([head, *needles[:4]]))
    path = tmp_path / "few.toml"
    path.write_text(STUDY + 'insert_mm_per_s = { uniform = [30.0, 60.0] }\n')
    return path


def test_a_needle_of_a_study_is_a_rehearsal(study, tmp_path):
    study.write_text(STUDY)
    rows = stylet.study(study, tmp_path / "out", jobs=1)
    stage = stylet.Stage(stylet.Scene("paper"), linear=True)
    seeds = rows["seeds"]
    needles = tomllib.loads(study.with_name("plan.toml").read_text())["needle"]
    assert len(needles) == 4
    for number, planned in enumerate(needles):
        mine = seeds["insertion"] == number
        pitch = 4.5 + planned["spacer_mm"]
        done = stage.rehearse(planned["entry_mm"], AXIS, planned["seed_along_mm"], strand_pitch_mm=pitch)
        assert same_bits(done.seeds_mm, seeds["rest_mm"][mine])
        assert same_bits(done.axes, seeds["rest_axis"][mine])
        assert same_bits(done.dropped_after_s, seeds["dropped_after_s"][mine])
        assert done.peak_force_n == rows["insertions"]["peak_force_n"][number]


def test_the_digest_is_that_of_any_threads_and_of_the_program(study, tmp_path):
    one = stylet.study(study, tmp_path / "one", jobs=1)
    two = stylet.study(study, tmp_path / "two", jobs=2)
    assert one["digest"] == two["digest"] and len(one["digest"]) == 64
    assert one["digest"] == stylet.study(study, tmp_path / "one")["digest"], "what is there is not run again"
    assert set(one["insertions"]["insert_mm_per_s"]) and len(set(one["insertions"]["insert_mm_per_s"])) == 4
    programs = pathlib.Path(os.environ.get("STYLET_PROGRAMS", ""))
    if (programs / "rt-core").exists():
        command = [programs / "rt-core", "study", study, "--out", tmp_path / "program"]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert one["digest"] in said, said


def test_what_is_wrong_with_a_study_is_said_at_once(study, tmp_path):
    study.write_text(STUDY.replace("paper", "knee") + "hand_mass_kg = 7.0\nlength = 1.0\n")
    with pytest.raises(ValueError) as error:
        stylet.study(study, tmp_path / "out")
    for word in ("knee", "hand_mass_kg", "length"):
        assert word in str(error.value)


def test_a_rehearsal_has_a_hand_and_limits(paper):
    stage = stylet.Stage(paper, linear=True)
    usual = stage.rehearse(ENTRY_MM, AXIS, [45.0, 35.0])
    assert same_bits(usual.seeds_mm, stage.rehearse(ENTRY_MM, AXIS, [45.0, 35.0]).seeds_mm)
    assert np.allclose(usual.planned_mm[:, 2], [ENTRY_MM[2] + 45.0, ENTRY_MM[2] + 35.0])
    assert (usual.planned_mm[:, 2] > usual.seeds_mm[:, 2]).all(), "seeds rest short of their places"
    heavy = stage.rehearse(ENTRY_MM, AXIS, [45.0, 35.0], hand=(1.0, 20.0, 1000.0))
    assert not same_bits(usual.seeds_mm, heavy.seeds_mm)
    with pytest.raises(ValueError, match="deepest"):
        stage.rehearse(ENTRY_MM, AXIS, [35.0, 45.0])
    with pytest.raises(ValueError, match="m/s is 5"):
        stage.rehearse(ENTRY_MM, AXIS, [35.0], insert_mm_per_s=5000.0)
    with pytest.raises(ValueError, match="hand"):
        stage.rehearse(ENTRY_MM, AXIS, [35.0], hand=(0.0, 5.0, 300.0))
