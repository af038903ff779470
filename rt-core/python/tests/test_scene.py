"""Scenes by name, of arrays and of files; parameters."""

import numpy as np
import pytest
import stylet
from conftest import ENTRY_MM, ROOT


def test_built_in_scenes_have_structures_and_a_target():
    assert stylet.scenes() == ["paper", "pelvis", "full"]
    pelvis = stylet.Scene("pelvis")
    roles = {structure.role for structure in pelvis.structures}
    assert {"target", "spare", "tissue"} == roles
    labels = pelvis.labels
    assert labels.shape == pelvis.shape and labels.dtype == np.uint8 and labels.flags.f_contiguous
    for structure in pelvis.structures:
        cc = np.count_nonzero(labels == structure.label) * pelvis.spacing_mm**3 / 1000
        assert cc == pytest.approx(structure.volume_cc)
    with pytest.raises(ValueError, match="paper, pelvis, full"):
        stylet.Scene("knee")


def test_the_gland_of_the_paper_has_its_volume_in_points(paper):
    gland = paper.structures[0]
    assert gland.volume_cc == pytest.approx(49.0, abs=0.1)
    points, volumes = paper.points(pitch_mm=1.0)
    assert points.shape == (len(volumes), 3)
    assert volumes.sum() == pytest.approx(gland.volume_cc, rel=2e-3)
    assert (points >= gland.lower_mm).all() and (points <= gland.upper_mm).all()


def test_an_array_gives_the_forces_of_the_scene_it_was_taken_from(paper):
    gland, edge_mm = paper.structures[0], paper.spacing_mm
    named = {gland.label: {"name": gland.name, "role": "target", "young_kpa": gland.young_kpa}}
    copy = stylet.Scene.of_labels(paper.labels, [edge_mm] * 3, named, origin_mm=[edge_mm / 2] * 3)
    assert copy.structures[0].volume_cc == pytest.approx(gland.volume_cc)
    entry = copy.to_scene([ENTRY_MM])
    assert np.allclose(copy.to_patient(entry), ENTRY_MM)
    ours = stylet.Insertion(copy, entry[0]).move(40.0)["resistance_n"]
    built_in = stylet.Insertion(paper, ENTRY_MM).move(40.0)["resistance_n"]
    assert built_in.max() > 2.0
    assert np.abs(ours - built_in).max() < 1e-3


def test_materials_change_the_tissue(paper):
    soft = stylet.Insertion(stylet.Scene("paper", stiffness=0.5), ENTRY_MM, linear=True).move(45.0)
    stiff = stylet.Insertion(paper, ENTRY_MM, linear=True).move(45.0)
    assert soft["displacement_mm"][-1] > 1.3 * stiff["displacement_mm"][-1]
    labels = np.zeros((20, 20, 30), np.uint8)
    labels[4:16, 4:16, 4:26] = 1
    block = stylet.Scene.of_labels(labels, [2.0] * 3, {1: {"name": "Prostate", "young_kpa": 30.0}})
    assert block.structures[0].young_kpa == pytest.approx(30.0)
    assert block.structures[0].role == "target", "by its name"
    with pytest.raises(ValueError, match="young_kpa, poisson"):
        stylet.Scene.of_labels(labels, [2.0] * 3, {1: {"name": "Prostate", "young": 30.0}})
    with pytest.raises(ValueError, match="poisson is 0.6"):
        stylet.Scene.of_labels(labels, [2.0] * 3, {1: {"name": "Prostate", "poisson": 0.6}})
    with pytest.raises(ValueError, match="no voxel|has a voxel"):
        stylet.Scene.of_labels(labels, [2.0] * 3, {7: "Prostate"})


def test_a_file_of_labels_is_read_as_the_programs_read_it():
    folder = ROOT / "tests/files/data/labels"
    read = stylet.read_labels(folder / "layers.seg.nrrd")
    assert read["labels"].dtype == np.uint8 and read["names"]
    assert read["patient_from_voxel"].shape == (3, 4)
    scene = stylet.Scene.read(folder / "layers.seg.nrrd")
    assert {structure.name for structure in scene.structures} <= set(read["names"].values())
    with pytest.raises(ValueError, match="missing.nrrd"):
        stylet.Scene.read("missing.nrrd")


def test_a_plan_and_a_structure_set_of_dicom_are_read():
    folder = ROOT / "tests/files/data/dicom"
    plan = stylet.read_plan(folder / "plan_single.dcm")
    assert plan["seeds_mm"].shape == plan["axes"].shape == (len(plan["strength_u"]), 3)
    assert len(plan["holes"]) == len(plan["strength_u"]) > 0
    assert stylet.Scene.read(folder / "structures.dcm").structures
    with pytest.raises(ValueError, match="plan_hdr.dcm"):
        stylet.read_plan(folder / "plan_hdr.dcm")


def test_parameters_are_the_table_of_the_programs():
    rows = {row.key: row for row in stylet.parameters()}
    table = (ROOT / "shm-schema/settings/src/table.rs").read_text()
    assert all(f'"{key}"' in table for key in rows) and len(rows) > 50
    depth = rows["needle.puncture_depth"]
    assert (depth.unit, depth.least, depth.default, depth.most) == ("mm", 0.5, 8.0, 20.0)
    assert list(stylet.tissues()) == ["chainmail", "fem", "paper"]
