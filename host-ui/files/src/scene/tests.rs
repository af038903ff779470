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
[needle]
insert_mm_per_s = 5
[device]
name = "sim"
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
    assert_eq!((scene.device.as_deref(), scene.retract_m_per_s), (Some("sim"), None));
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
    assert!(wrong.contains("six of them"), "{wrong}");
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
fn every_problem_of_a_scene_file_is_reported_at_once() {
    let wrong = r#"
nmae = "x"
[volume]
[[structure]]
role = "targte"
[[structure]]
label = 300
young_kpa = "soft"
stretch = [1.2, 0.8]
[[structure]]
label = 1
name = "Prostate"
poisson = 0.5
[needle]
speed = 3
insert_mm_per_s = 9000
[device]
name = 7
"#;
    let why = parse(wrong).unwrap_err().to_string();
    for expected in [
        "nmae is not known",
        "[volume] file is missing",
        "[[structure]] 1: label or name is missing",
        "[[structure]] 1: role must be",
        "[[structure]] 2: label must be a number from 1 to 255",
        "[[structure]] 2: young_kpa must be a number",
        "[[structure]] 2: stretch and shear_deg belong together",
        "[[structure]] 3: label and name are both there",
        "[[structure]] 3: poisson must be",
        "[needle] speed is not known",
        "[needle] insert_mm_per_s must be a number from 0.1 to 500",
        "[device] name must be a text",
    ] {
        assert!(why.contains(expected), "{expected}:\n{why}");
    }
    assert!(parse("").unwrap_err().to_string().contains("[volume] file is missing"));
    assert!(parse("volume = 3").unwrap_err().to_string().contains("must be a table"));
    assert!(parse("= 3").unwrap_err().to_string().contains("not TOML"));
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
