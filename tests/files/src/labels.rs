//! Label volumes written by SimpleITK and pynrrd are placed as those programs say, and files of each of our writers are
//! read back.

use std::collections::BTreeMap;
use std::path::PathBuf;
use stylet_files::{self as files, Voxels};
use stylet_test_kit::scratch;

fn folder() -> PathBuf {
    stylet_test_kit::repository("tests/files/data/labels")
}

/// Number of voxels and their centre (RAS, mm) by label.
type Centres = BTreeMap<u8, (usize, [f64; 3])>;

fn centres(v: &Voxels) -> Centres {
    let mut found = Centres::new();
    for (index, &label) in v.labels.iter().enumerate().filter(|(_, l)| **l != 0) {
        let at = [
            index % v.dims[0],
            index / v.dims[0] % v.dims[1],
            index / v.dims[0] / v.dims[1],
        ];
        let place_m = v.frame.place_m(at.map(|i| i as f64));
        let (count, sum) = found.entry(label).or_default();
        *count += 1;
        (0..3).for_each(|a| sum[a] += place_m[a] * 1e3);
    }
    for (count, sum) in found.values_mut() {
        *sum = sum.map(|s| s / *count as f64);
    }
    found
}

fn expected() -> BTreeMap<String, Centres> {
    let mut all: BTreeMap<String, Centres> = BTreeMap::new();
    let mut table = csv::Reader::from_path(folder().join("expected.csv")).expect("expected.csv");
    for row in table.records() {
        let row = row.expect("a row");
        let number = |i: usize| row[i].parse::<f64>().expect("a number");
        let of_file = all.entry(row[0].to_owned()).or_default();
        of_file.insert(number(1) as u8, (number(2) as usize, [number(3), number(4), number(5)]));
    }
    all
}

fn assert_near(name: &str, found: &Centres, expected: &Centres) {
    assert_eq!(
        found.keys().collect::<Vec<_>>(),
        expected.keys().collect::<Vec<_>>(),
        "{name}"
    );
    for (label, (count, centre)) in expected {
        let (found_count, found_centre) = found[label];
        assert_eq!(found_count, *count, "{name}, label {label}");
        let off = (0..3).map(|a| (found_centre[a] - centre[a]).abs()).fold(0.0, f64::max);
        // NIfTI keeps its affine in single precision.
        assert!(off < 2e-5, "{name}, label {label}: {found_centre:?} and not {centre:?}");
    }
}

#[test]
fn volumes_of_other_programs_lie_where_they_say() {
    let expected = expected();
    assert!(expected.len() >= 17, "{}", expected.len());
    for (name, centres_mm) in &expected {
        let voxels =
            files::read_voxels(&folder().join(name), &files::Progress::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_near(name, &centres(&voxels), centres_mm);
        assert_eq!(
            voxels.overlap.is_some() || voxels.frame.warning.is_some(),
            name == "layers.seg.nrrd",
            "{name}: {:?}",
            voxels.frame.warning
        );
    }
}

#[test]
fn segments_of_slicer_keep_their_names_and_what_overlaps_is_reported() {
    let voxels = files::read_voxels(&folder().join("layers.seg.nrrd"), &files::Progress::default()).expect("read");
    let names: Vec<&str> = voxels.names.values().map(String::as_str).collect();
    assert_eq!(names, ["Prostate", "Rectum", "Urethra"]);
    let warning = voxels.overlap.expect("an overlap");
    assert!(warning.contains("Prostate (18 of 100 voxels)"), "{warning}");
}

#[test]
fn a_volume_without_orientation_says_so() {
    let voxels = files::read_voxels(&folder().join("pynrrd_spacings.nrrd"), &files::Progress::default()).expect("read");
    let off = [0.7e-3, 0.9e-3, 2.5e-3]
        .iter()
        .zip(voxels.frame.spacing_m)
        .map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-15);
    let warning = voxels.frame.warning.expect("a note");
    assert!(warning.contains("no anatomical space"), "{warning}");
}

#[test]
fn what_is_written_is_read_back_the_same() {
    let folder_out = scratch("labels-written");
    for from in ["itk_mirrored.nrrd", "layers.seg.nrrd", "itk_u8.nii.gz"] {
        let first = files::read_voxels(&folder().join(from), &files::Progress::default()).expect("read");
        for to in ["a.nrrd", "a.seg.nrrd", "a.mha", "a.nii.gz"] {
            let path = folder_out.join(to);
            files::convert::write_labels(&first, &path, None).expect("written");
            let again = files::read_voxels(&path, &files::Progress::default()).expect("read again");
            assert_eq!(again.labels, first.labels, "{from} to {to}");
            assert_near(&format!("{from} to {to}"), &centres(&again), &centres(&first));
            if to.ends_with("nrrd") {
                assert_eq!(again.names, first.names);
            }
        }
    }
}

#[test]
fn a_header_reaches_no_file_outside_of_its_folder() {
    let out = scratch("labels-beside");
    let text = std::fs::read_to_string(folder().join("itk_detached.mhd")).expect("a header");
    for name in ["/etc/passwd", "../itk_detached.raw", "a/b.raw", "..", "."] {
        let path = out.join("header.mhd");
        std::fs::write(&path, text.replace("itk_detached.raw", name)).expect("written");
        let why = files::read_voxels(&path, &files::Progress::default())
            .expect_err(name)
            .to_string();
        assert!(why.contains("only a file in the same folder"), "{name}: {why}");
    }
    let path = out.join("header.mhd");
    std::fs::write(&path, text.replace("itk_detached.raw", "missing.raw")).expect("written");
    let why = files::read_voxels(&path, &files::Progress::default())
        .expect_err("missing")
        .to_string();
    assert!(why.contains("missing.raw: it cannot be opened"), "{why}");
}
