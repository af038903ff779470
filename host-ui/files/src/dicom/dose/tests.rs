//! A dose that was written reads back equal, for any direction of its grid.

use super::super::Identity;
use super::*;

fn values(dims: [usize; 3]) -> Vec<f64> {
    (0..dims.iter().product())
        .map(|n| 1.0 + (n as f64 * 0.37).sin().powi(2) * 300.0)
        .collect()
}

/// Guards against an RT Dose that was written and could not be read.
#[test]
fn a_dose_read_back_equals_what_was_written() {
    let (dims, identity) = ([5, 4, 3], Identity::new());
    let dose_gy = values(dims);
    let image = DoseImage {
        dims,
        origin_m: [-0.031, 0.0125, 0.4],
        spacing_m: [1e-3, 2e-3, 2.5e-3],
        dose_gy: &dose_gy,
        kind: &DoseKind::default(),
    };
    let histograms = [Histogram {
        structure: 2,
        bin_gy: 1.0,
        at_least_m3: vec![3e-5, 1e-5, 0.0],
        range_gy: [0.5, 1.0, 2.0],
    }];
    let of = DoseOf {
        uid: "2.25.7",
        identity: &identity,
        plan: "2.25.8",
        structure_set: Some("2.25.9"),
        histograms: &histograms,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dose");
    std::fs::write(&path, bytes(&image, &of).unwrap()).unwrap();
    let found = of_file(&path).unwrap();
    assert_eq!((&found.kind, found.notes.as_slice()), (image.kind, [].as_slice()));
    assert_eq!((found.uid.as_str(), found.plan.as_deref()), ("2.25.7", Some("2.25.8")));
    assert_eq!(found.structure_set.as_deref(), Some("2.25.9"));
    assert_eq!(found.dims, dims);
    for a in 0..3 {
        assert!((found.origin_m[a] - image.origin_m[a]).abs() < 1e-12);
        assert!((found.spacing_m[a] - image.spacing_m[a]).abs() < 1e-12);
    }
    let highest = dose_gy.iter().copied().fold(0.0, f64::max);
    for (read, written) in found.dose_gy.iter().zip(&dose_gy) {
        // Half a step of 32 bits.
        assert!(
            (read - written).abs() <= highest / f64::from(u32::MAX) * 0.51,
            "{read} and {written}"
        );
    }
    // Truncated in the pixels.
    let mut short = std::fs::read(&path).unwrap();
    short.truncate(short.len() - 5);
    std::fs::write(&path, short).unwrap();
    assert!(of_file(&path).is_err());
}

/// Writes a dose of a kind, and reads it again after a change of its attributes.
fn again(kind: &DoseKind, dose_gy: &[f64], change: impl Fn(&mut Vec<u8>)) -> Result<ReadDose, String> {
    let identity = Identity::new();
    let image = DoseImage {
        dims: [2, 2, 2],
        origin_m: [0.0; 3],
        spacing_m: [1e-3; 3],
        dose_gy,
        kind,
    };
    let of = DoseOf {
        uid: "2.25.7",
        identity: &identity,
        plan: "2.25.8",
        structure_set: None,
        histograms: &[],
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dose");
    let mut content = bytes(&image, &of).map_err(|why| why.to_string())?;
    change(&mut content);
    std::fs::write(&path, content).unwrap();
    of_file(&path).map_err(|why| why.to_string())
}

fn replaced(content: &mut [u8], from: &[u8], to: &[u8]) {
    let at = content.windows(from.len()).position(|part| part == from).unwrap();
    content[at..at + to.len()].copy_from_slice(to);
}

const DOSES: [f64; 8] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];

/// Guards against EFFECTIVE, ERROR, BEAM and others that became PHYSICAL and PLAN.
#[test]
fn type_and_summation_are_kept_reported_or_refused() {
    let kind = |dose_type: &str| DoseKind {
        dose_type: dose_type.to_owned(),
        ..DoseKind::default()
    };
    for dose_type in ["EFFECTIVE", "ERROR"] {
        let read = again(&kind(dose_type), &DOSES, |_| ()).unwrap();
        assert_eq!(read.kind, kind(dose_type));
        assert!(
            read.notes[0].contains("DoseType") && read.notes[0].contains(dose_type),
            "{:?}",
            read.notes
        );
        assert!(read.kind.comparable(&DoseKind::default()).is_err() && read.kind.comparable(&read.kind).is_ok());
        let lines = read.kind.comments() + &read.kind.pairs();
        let line = |name: &str| {
            let value = lines
                .lines()
                .find_map(|line| line.strip_prefix("# ")?.strip_prefix(name)?.strip_prefix(": "));
            value.map(str::to_owned)
        };
        assert_eq!(DoseKind::of_lines(line), read.kind);
    }
    for summation in ["BEAM", "RECORD"] {
        let part = |content: &mut Vec<u8>| {
            // As long as PLAN, or with two letters more after another element of that length.
            replaced(content, b"PLAN", &summation.as_bytes()[..4]);
        };
        match again(&DoseKind::default(), &DOSES, part) {
            Ok(read) => {
                assert_eq!(read.kind.summation, summation);
                assert!(read.notes[0].contains("DoseSummationType"), "{:?}", read.notes);
                let why = again(&read.kind, &DOSES, |_| ()).unwrap_err();
                assert!(why.contains("DoseSummationType") && why.contains(".nrrd"), "{why}");
            }
            Err(why) => assert!(why.contains("DoseSummationType") && why.contains("RECO"), "{why}"),
        }
    }
    let missing = again(&DoseKind::default(), &DOSES, |content| {
        replaced(content, b"PHYSICAL", b"        ")
    })
    .unwrap();
    assert_eq!(missing.kind, DoseKind::default());
    assert!(
        missing.notes[0].contains("DoseType") && missing.notes[0].contains("missing"),
        "{:?}",
        missing.notes
    );
}

/// Guards against a difference of doses that was "nowhere above 0".
#[test]
fn only_differences_have_negative_doses() {
    let doses = DOSES.map(|gy| 4.5 - gy);
    let kind = DoseKind {
        dose_type: "ERROR".to_owned(),
        ..DoseKind::default()
    };
    let read = again(&kind, &doses, |_| ()).unwrap();
    assert!(
        read.dose_gy.iter().zip(&doses).all(|(a, b)| (a - b).abs() < 1e-8),
        "{:?}",
        read.dose_gy
    );
    assert!(
        read.notes.iter().any(|note| note.contains("-3.500 Gy")),
        "{:?}",
        read.notes
    );
    let why = again(&DoseKind::default(), &doses, |_| ()).unwrap_err();
    assert!(why.contains("negative") && why.contains("-3.500 Gy"), "{why}");
    assert!(again(&kind, &[0.0; 8], |_| ()).unwrap_err().contains("0 everywhere"));
}
