//! Seeds of a plan keep their needles.

use super::*;
use crate::plan::exchange::seeds_of_source;
use stylet_dose::Source;
use stylet_files::dicom::Identity;

fn plan() -> Vec<u8> {
    let seed = |(needle, hole, z_m): (Option<u32>, &str, f64)| PlanSeed {
        needle,
        hole: hole.to_owned(),
        position_m: [0.0, 0.0, z_m],
        axis: None,
        strength_u: 0.5,
        strength_on: None,
    };
    let seeds = [(Some(3), "D4", 0.01), (Some(3), "D4", 0.02), (Some(1), "", 0.03)];
    let seeds = seeds.into_iter().map(seed).collect();
    let source = Source::known("6711").unwrap();
    let plan = seeds_of_source(&source, seeds, Some(145.0), Identity::new());
    dicom::plan::bytes(&plan).unwrap()
}

/// Guards against seeds that lost needle and hole, although the reader of plans found them.
#[test]
fn seeds_of_a_plan_keep_needle_and_hole() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["plan.dcm", "plan", "PLAN.IMG"] {
        let path = folder.path().join(name);
        std::fs::write(&path, plan()).unwrap();
        let file = read_seeds(&path, SeedDefaults::default()).unwrap();
        assert!(file.declared.is_some(), "{name} is a plan");
        let found: Vec<_> = file.rows.iter().map(|r| (r.needle, r.hole.as_str())).collect();
        assert_eq!(found, [(Some(3), "D4"), (Some(3), "D4"), (Some(1), "")]);
    }
}

/// Guards against waiting for a pipe, and against reading a device until memory ran out.
#[test]
fn a_pipe_and_a_device_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("seeds.csv");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    for path in [pipe.as_path(), Path::new("/dev/zero")] {
        let why = read_seeds(path, SeedDefaults::default()).unwrap_err().to_string();
        assert!(why.contains("it is not a file"), "{why}");
    }
}

/// Guards against refused columns for the certainty of a seed in a CT.
#[test]
fn a_table_of_seeds_found_in_a_ct_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("seeds.csv");
    let header = [PLACE.as_slice(), &AXIS, &FOUND].concat().join(",");
    std::fs::write(&path, format!("{header}\n1,2,3,0,0,1,0.98,0.12,2\n")).unwrap();
    let defaults = SeedDefaults {
        strength_u: Some(0.45),
        ..SeedDefaults::default()
    };
    let seeds = read_seeds(&path, defaults).unwrap().rows;
    assert_eq!((seeds.len(), seeds[0].axis), (1, Some([0.0, 0.0, 1.0])));
}
