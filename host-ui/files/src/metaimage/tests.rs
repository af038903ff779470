//! Headers written by hand, good and broken.

use super::*;
use crate::Progress;

fn read(bytes: &[u8], data_file: DataReader) -> Result<VoxelValues<u8>, ContentError> {
    super::read(bytes, data_file, Sink::labels(&Progress::default()))
}

fn no_file(name: &str) -> Result<Vec<u8>, ContentError> {
    Err(format!("no file {name}").into())
}

const GOOD: &str = "ObjectType = Image\nNDims = 3\nBinaryData = False\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\n\
                    Offset = 1 2 3\nElementSpacing = 1 2 3\nDimSize = 2 2 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n0 1 2 3";

fn with(from: &str, to: &str) -> Vec<u8> {
    assert!(GOOD.contains(from), "{from}");
    GOOD.replace(from, to).into_bytes()
}

#[test]
fn each_row_of_the_matrix_is_an_axis_and_the_patient_is_in_lps() {
    let v = read(GOOD.as_bytes(), &no_file).unwrap();
    assert_eq!(v.values, [0, 1, 2, 3]);
    assert_eq!(v.frame.origin_m, Vector3::new(-1e-3, -2e-3, 3e-3));
    // The first axis points to posterior: -y in RAS.
    let step = v.frame.columns_m().column(0) - Vector3::new(0.0, -1e-3, 0.0);
    assert!(step.norm() < 1e-12);
    assert!(v.frame.warning.is_none());
}

#[test]
fn letters_without_a_matrix_are_refused_unless_they_are_the_usual_ones() {
    let lettered = |letters: &str| {
        let line = format!("AnatomicalOrientation = {letters}");
        read(&with("TransformMatrix = 0 1 0 -1 0 0 0 0 1", &line), &no_file).map(|v| v.frame)
    };
    // From right, anterior, inferior: to left, posterior, superior.
    let lps = lettered("RAI").unwrap();
    assert_eq!(lps.directions.column(0), -Vector3::x());
    assert_eq!(lps.directions.column(1), -Vector3::y());
    assert!(lettered("SLP").unwrap_err().to_string().contains("SLP"));
    let unknown = lettered("???").unwrap().warning.unwrap();
    assert!(unknown.contains("does not give the patient's orientation"), "{unknown}");
}

#[test]
fn each_wrong_header_is_refused_with_its_reason() {
    for (from, to, expected) in [
        (
            "DimSize = 2 2 1",
            "DimSize = 1000000 1000000 1",
            "claims 1000000 x 1000000 x 1",
        ),
        ("DimSize = 2 2 1", "DimSize = 2 2 0", "at least 1"),
        ("DimSize = 2 2 1", "DimSize = 2 -2 1", "3 whole numbers"),
        ("NDims = 3", "NDims = 2", "NDims is \"2\""),
        ("NDims = 3", "NDims = 3\nNDims = 3", "there twice"),
        ("NDims = 3", "NDims = 3\nOrigin = 1 2 4", "Origin says otherwise"),
        ("Image", "Tube", "ObjectType is \"Tube\""),
        ("MET_UCHAR", "MET_STRING", "a type of whole numbers"),
        ("MET_UCHAR", "MET_UCHAR\nElementNumberOfChannels = 3", "single numbers"),
        ("BinaryData = False", "BinaryData = maybe", "True or False"),
        ("BinaryData = False", "BinaryData = True", "7 are there"),
        (
            "BinaryData = False",
            "BinaryData = True\nCompressedData = True",
            "truncated or damaged",
        ),
        ("0 -1 0 0 0 0 1", "0 -1 0 0 0 0", "9 numbers"),
        ("0 -1 0 0 0 0 1", "0 -1 0 0 0 0 2", "scales as well"),
        ("0 -1 0 0 0 0 1", "0 -1 0 0 0 1 1", "sheared"),
        ("ElementSpacing = 1 2 3\n", "", "ElementSpacing is missing"),
        ("ElementSpacing = 1 2 3", "ElementSpacing = 1 2 1e9", "0.01 to 100 mm"),
        ("LOCAL", "LIST", "several files"),
        ("LOCAL", "slice%03d.raw", "several files"),
        ("LOCAL", "other.raw", "no file other.raw"),
        ("ElementDataFile = LOCAL\n0 1 2 3", "", "no ElementDataFile"),
        ("0 1 2 3", "0 1 2 3 4", "more than the 4"),
    ] {
        let why = read(&with(from, to), &no_file).map(|v| v.values).expect_err(to);
        assert!(why.to_string().contains(expected), "{to}: {why}");
    }
}
