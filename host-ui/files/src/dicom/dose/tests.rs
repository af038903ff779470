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
    assert_eq!(found.identity, identity);
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
