//! Scene files, valid ones and one with every error at once.

use super::*;
use nalgebra::{Matrix3, Vector3};

const FULL: &str = r#"
name = "phantom"
[volume]
file = "gland.nrrd"
[image]
file = "trus.nii.gz"
[[structure]]
name = "Prostate"
young_kpa = 20
stretch = [0.6, 1.5]
shear_deg = 25
surroundings = ["fat", "fat", "fat", "fat", "free", "fixed"]
[[structure]]
label = 2
called = "Rectum"
fixed = true
surroundings = "free"
[[structure]]
label = 3
role = "leave out"
[[layer]]
thickness_mm = 4
young_kpa = 40
[[layer]]
thickness_mm = 15
young_kpa = 3
[needle]
insert_mm_per_s = 5
[device]
name = "simulated"
[plan]
file = "plan.dcm"
"#;

fn voxels() -> Voxels {
    Voxels {
        dims: [4, 4, 4],
        labels: (0..64).map(|i| [1, 2, 3, 4][i / 16]).collect(),
        frame: crate::VoxelFrame::new(Matrix3::identity() * 2e-3, Vector3::zeros(), "test").unwrap(),
        names: [(1, "Prostate".to_owned())].into(),
        also: Vec::new(),
        overlap: None,
    }
}

#[test]
fn structures_get_the_materials_of_the_file() {
    let scene = parse(FULL).unwrap();
    assert_eq!(scene.insert_m_per_s, Some(5e-3));
    assert_eq!(scene.image.as_deref(), Some(Path::new("trus.nii.gz")));
    assert_eq!(
        (scene.device.as_deref(), scene.retract_m_per_s),
        (Some("simulated"), None)
    );
    let layers = [(4e-3, 40e3), (15e-3, 3e3)].map(|(thickness_m, young_pa)| Layer { thickness_m, young_pa });
    assert_eq!(scene.layers, layers);
    let tissues = scene.tissues(&voxels()).unwrap();
    let names: Vec<(&str, Role)> = tissues.iter().map(|t| (t.name.as_str(), t.role)).collect();
    assert_eq!(names, [("Prostate", Role::Target), ("Rectum", Role::Spare)]);
    assert_eq!(tissues[0].material.young_pa, 20e3);
    let limits = tissues[0].material.limits.unwrap()[2];
    assert!((limits[2] - 25_f64.to_radians()).abs() < 1e-12 && limits[0] == 0.6);
    assert!(tissues[1].material.fixed);
    assert_eq!(tissues[1].material.surroundings, Surroundings::all(Beyond::Free));
    assert_eq!(
        tissues[0].material.surroundings.0[3..],
        [Beyond::Fat, Beyond::Free, Beyond::Fixed]
    );
    let wrong = parse(&FULL.replace("\"fixed\"]", "\"fixed\", \"air\"]"))
        .unwrap_err()
        .to_string();
    assert!(wrong.contains("list of six words"), "{wrong}");
    let volume = LabelVolume::from_tissues(&voxels(), tissues, "v".to_owned(), &Progress::default()).unwrap();
    let cells = |label: u8| volume.cells.iter().filter(|&&c| c == label).count();
    assert_eq!([1, 2, 3, 4].map(cells), [16, 16, 0, 0]);
    assert!(
        volume
            .warnings
            .iter()
            .any(|w| w.contains("left out: 3 (16 voxels), 4 (16 voxels)")),
        "{:?}",
        volume.warnings
    );
}

#[test]
fn every_wrong_value_of_a_scene_file_is_reported_at_once() {
    let wrong = r#"
[volume]
file = "a"
[[structure]]
role = "spare"
[[structure]]
label = 0
stretch = [1.2, 0.8]
[[structure]]
label = 1
name = "Prostate"
poisson = 0.5
shear_deg = 90
[[structure]]
label = 2
young_kpa = 0
[[layer]]
thickness_mm = 0
young_kpa = -5
[needle]
insert_mm_per_s = 9000
retract_mm_per_s = nan
"#;
    let why = parse(wrong).unwrap_err().to_string();
    for expected in [
        "[[structure]] 1: give either label or name",
        "[[structure]] 2: label must be a number from 1 to 255",
        "[[structure]] 2: stretch and shear_deg belong together",
        "[[structure]] 2: stretch must be",
        "[[structure]] 3: give either label or name",
        "[[structure]] 3: poisson must be",
        "[[structure]] 3: shear_deg must be",
        "[[structure]] 4: young_kpa must be",
        "[[layer]] 1: thickness_mm must be a number from 1 to 100",
        "[[layer]] 1: young_kpa must be a number from 0.1 to 100000",
        "[needle] insert_mm_per_s must be a number from 0.1 to 500",
        "[needle] retract_mm_per_s must be a number",
    ] {
        assert!(why.contains(expected), "{expected}:\n{why}");
    }
}

#[test]
fn a_misspelt_scene_file_is_refused_with_the_line() {
    for (wrong, expected) in [
        ("", "missing field `volume`"),
        ("volume = 3", "line 1"),
        ("= 3", "line 1"),
        ("nmae = \"x\"\n[volume]\nfile = \"a\"", "unknown field `nmae`"),
        ("[volume]\nfile = \"a\"\n[needle]\nspeed = 3", "unknown field `speed`"),
        ("[volume]\nfile = \"a\"\n[device]\nname = 7", "line 4"),
        ("[volume]\nfile = \"a\"\n[[structure]]\nlabel = 300", "line 4"),
        (
            "[volume]\nfile = \"a\"\n[[structure]]\nrole = \"targte\"",
            "unknown variant `targte`",
        ),
    ] {
        let why = parse(wrong).unwrap_err().to_string();
        assert!(why.contains(expected), "{expected}:\n{why}");
    }
}

#[test]
fn missing_structures_are_reported_together() {
    let scene = parse("[volume]\nfile = \"a\"\n[[structure]]\nname = \"Bladder\"\n[[structure]]\nlabel = 9\n[[structure]]\nlabel = 1\n[[structure]]\nname = \"prostate\"").unwrap();
    let why = scene.tissues(&voxels()).unwrap_err().to_string();
    assert!(why.contains("no structure \"Bladder\"; it has Prostate"), "{why}");
    assert!(
        why.contains("no voxel with label 9") && why.contains("label 1 has a structure already"),
        "{why}"
    );
}

/// Guards against two copies of the example that each lacked fields of the other.
#[test]
fn the_documented_example_has_every_field() {
    let scene = parse(include_str!("../../../../scenes/example.toml")).unwrap();
    assert_eq!(scene.name.as_deref(), Some("phantom"));
    assert_eq!(scene.volume, Path::new("gland.nii.gz"));
    assert!(scene.image.is_some() && scene.device.is_some() && scene.plan.is_some());
    assert!(scene.insert_m_per_s.is_some() && scene.retract_m_per_s.is_some());
    let tissues = scene.tissues(&voxels()).unwrap();
    assert_eq!((tissues[0].name.as_str(), tissues[0].role), ("Prostate", Role::Target));
    assert!(tissues[0].material.limits.is_some());
}
