//! Series whose values encode the places of their voxels, against the geometry that they were
//! written with.

use super::super::segmentation;
use super::super::write::{bytes as file_bytes, common, decimals, item, sequence, string};
use super::*;
use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, VR};
use dicom_dictionary_std::uids;
use nalgebra::{Rotation3, Unit, Vector3};
use stylet_anatomy::ras_from_lps;

const COLUMNS: usize = 7;
const ROWS: usize = 5;
const SLICES: usize = 4;
const SPACING_MM: [f64; 3] = [0.6, 0.8, 2.5];
const CORNER_MM: [f64; 3] = [-31.0, 12.5, -140.0];

fn turn() -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(0.3, -0.2, 0.9)), 0.4)
}

/// Returns the stored value at a place (LPS, mm). Fractions would need 24 bits, so the slope has
/// them.
fn stored_at(place_mm: Vector3<f64>) -> i16 {
    (place_mm.x * 3.0 + place_mm.y * 5.0 - place_mm.z * 2.0).round() as i16
}

fn place_mm(i: usize, j: usize, k: usize) -> Vector3<f64> {
    let along = Vector3::new(
        i as f64 * SPACING_MM[0],
        j as f64 * SPACING_MM[1],
        k as f64 * SPACING_MM[2],
    );
    Vector3::from(CORNER_MM) + turn() * along
}

/// Returns twelve bits with a sign; the four above hold other data.
fn pixels(k: usize) -> Vec<u8> {
    let pixel = |n: usize| {
        let value = stored_at(place_mm(n % COLUMNS, n / COLUMNS, k));
        (value as u16 & 0x0fff | 0xa000).to_le_bytes()
    };
    (0..COLUMNS * ROWS).flat_map(pixel).collect()
}

fn short(tag: Tag, value: u16) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, VR::US, PrimitiveValue::from(value))
}

fn directions() -> Vec<f64> {
    let turn = turn();
    turn.matrix()
        .column(0)
        .iter()
        .chain(turn.matrix().column(1).iter())
        .copied()
        .collect()
}

/// Returns an image of a series, without a place.
fn image(series: &str, pixels: Vec<u8>) -> InMemDicomObject {
    let identity = Identity {
        study: "2.25.21".to_owned(),
        frame_of_reference: "2.25.22".to_owned(),
        study_time: String::new(),
        ..Identity::new()
    };
    let mut object = common(uids::CT_IMAGE_STORAGE, "CT", &identity);
    for element in [
        string(tags::SERIES_INSTANCE_UID, series),
        short(tags::SAMPLES_PER_PIXEL, 1),
        string(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2"),
        short(tags::ROWS, ROWS as u16),
        short(tags::COLUMNS, COLUMNS as u16),
        short(tags::BITS_ALLOCATED, 16),
        short(tags::BITS_STORED, 12),
        short(tags::HIGH_BIT, 11),
        short(tags::PIXEL_REPRESENTATION, 1),
        DataElement::new(tags::PIXEL_DATA, VR::OW, PrimitiveValue::U8(pixels.into())),
    ] {
        object.put(element);
    }
    object
}

/// Returns the slice `k` of a CT.
pub fn slice(series: &str, k: usize) -> InMemDicomObject {
    let mut object = image(series, pixels(k));
    for element in [
        decimals(tags::IMAGE_POSITION_PATIENT, place_mm(0, 0, k).as_slice()),
        decimals(tags::IMAGE_ORIENTATION_PATIENT, &directions()),
        decimals(tags::PIXEL_SPACING, &[SPACING_MM[1], SPACING_MM[0]]),
        decimals(tags::RESCALE_SLOPE, &[0.5]),
        decimals(tags::RESCALE_INTERCEPT, &[-1000.0]),
    ] {
        object.put(element);
    }
    object
}

fn put(folder: &Path, name: &str, object: InMemDicomObject) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, file_bytes(object).unwrap()).unwrap();
    path
}

/// Writes a series in an order other than that of the slices.
fn write_series(folder: &Path, series: &str, slices: &[usize]) -> PathBuf {
    let name = |k: &usize| format!("{series}.{}.dcm", (k * 7 + 3) % 5);
    let paths = slices.iter().map(|k| put(folder, &name(k), slice(series, *k)));
    paths.reduce(|_, last| last).unwrap()
}

fn check(volume: &VoxelValues<f32>) {
    assert_eq!(volume.dims, [COLUMNS, ROWS, SLICES]);
    for n in 0..COLUMNS * ROWS * SLICES {
        let at = [n % COLUMNS, n / COLUMNS % ROWS, n / COLUMNS / ROWS];
        // The same two axes, in either order.
        let place = ras_from_lps(volume.frame.place_m(at.map(|i| i as f64))) * 1e3;
        let expected = f64::from(stored_at(place)) * 0.5 - 1000.0;
        // A place on the edge of two whole numbers may be rounded to either.
        let off = (f64::from(volume.values[n]) - expected).abs();
        assert!(off <= 0.5, "{at:?}: {} instead of {expected}", volume.values[n]);
        let exact = place_mm(at[0], at[1], at[2]);
        assert!((place - exact).norm() < 1e-6, "{at:?}: {place} instead of {exact}");
    }
}

#[test]
fn a_series_has_its_place_and_rescaled_values() {
    let folder = tempfile::tempdir().unwrap();
    let file = write_series(folder.path(), "2.25.11", &[0, 1, 2, 3]);
    check(&read(folder.path(), &Progress::default()).unwrap());
    std::fs::write(folder.path().join("notes.txt"), "no image").unwrap();
    // Another series in the folder: the folder is refused with both named, a file is of one series.
    write_series(folder.path(), "2.25.12", &[0, 1]);
    check(&read(&file, &Progress::default()).unwrap());
    let why = read(folder.path(), &Progress::default()).unwrap_err().to_string();
    assert!(
        why.contains("2 series") && why.contains("2.25.11") && why.contains("2.25.12"),
        "{why}"
    );
}

#[test]
fn a_segmentation_beside_a_series_is_no_series() {
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), "2.25.11", &[0, 1, 2, 3]);
    let structures = segmentation::write::bytes(&segmentation::tests::volume(false), &Identity::new()).unwrap();
    std::fs::write(folder.path().join("1.dcm"), structures).unwrap();
    check(&read(folder.path(), &Progress::default()).unwrap());
    assert_eq!(modality(folder.path()).unwrap().unwrap().0, "CT");
}

/// Rounded positions used to be refused with the words for a missing slice.
#[test]
fn positions_that_are_rounded_too_coarsely_are_refused_as_such() {
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), "2.25.11", &[0, 1, 3]);
    let mut moved = slice("2.25.11", 2);
    let place_mm = place_mm(0, 0, 2) + Vector3::new(0.0, 0.0, 0.1);
    moved.put(decimals(tags::IMAGE_POSITION_PATIENT, place_mm.as_slice()));
    put(folder.path(), "moved.dcm", moved);
    let why = read(folder.path(), &Progress::default()).unwrap_err().to_string();
    assert!(why.contains("seem to be rounded"), "{why}");
}

/// A slice that is shifted within its plane used to be read where it is not.
#[test]
fn a_slice_aside_of_the_others_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), "2.25.11", &[0, 1, 3]);
    let mut moved = slice("2.25.11", 2);
    let place_mm = place_mm(2, 0, 2);
    moved.put(decimals(tags::IMAGE_POSITION_PATIENT, place_mm.as_slice()));
    put(folder.path(), "moved.dcm", moved);
    let why = read(folder.path(), &Progress::default()).unwrap_err().to_string();
    assert!(why.contains("mm aside of the others"), "{why}");
}

#[test]
fn missing_and_duplicate_slices_are_reported() {
    for slices in [&[0, 1, 3][..], &[0][..]] {
        let folder = tempfile::tempdir().unwrap();
        write_series(folder.path(), "2.25.11", slices);
        let why = read(folder.path(), &Progress::default()).unwrap_err().to_string();
        assert!(
            why.contains("some are missing") || why.contains("one slice alone"),
            "{why}"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), "2.25.11", &[0, 1, 2, 3]);
    put(folder.path(), "again.dcm", slice("2.25.11", 2));
    let why = read(folder.path(), &Progress::default()).unwrap_err().to_string();
    assert!(why.contains("are there twice"), "{why}");
}

/// Returns frames in any order, with common attributes stated once.
fn multi_frame(order: &[usize]) -> InMemDicomObject {
    let mut object = image("2.25.13", order.iter().flat_map(|k| pixels(*k)).collect());
    let own = order.iter().map(|k| {
        let place = item([decimals(tags::IMAGE_POSITION_PATIENT, place_mm(0, 0, *k).as_slice())]);
        item([sequence(tags::PLANE_POSITION_SEQUENCE, vec![place])])
    });
    let orientation = item([decimals(tags::IMAGE_ORIENTATION_PATIENT, &directions())]);
    let measures = item([decimals(tags::PIXEL_SPACING, &[SPACING_MM[1], SPACING_MM[0]])]);
    let values = item([
        decimals(tags::RESCALE_INTERCEPT, &[-1000.0]),
        decimals(tags::RESCALE_SLOPE, &[0.5]),
    ]);
    let shared = item([
        sequence(tags::PLANE_ORIENTATION_SEQUENCE, vec![orientation]),
        sequence(tags::PIXEL_MEASURES_SEQUENCE, vec![measures]),
        sequence(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE, vec![values]),
    ]);
    for element in [
        string(tags::SOP_CLASS_UID, uids::ENHANCED_MR_IMAGE_STORAGE),
        string(tags::NUMBER_OF_FRAMES, &order.len().to_string()),
        sequence(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, vec![shared]),
        sequence(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, own.collect()),
    ] {
        object.put(element);
    }
    object
}

#[test]
fn an_enhanced_image_is_the_same_volume_in_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "enhanced", multi_frame(&[2, 0, 3, 1]));
    check(&read(&path, &Progress::default()).unwrap());
    check(&read(folder.path(), &Progress::default()).unwrap());
    check(&crate::image::read_values(folder.path(), &Progress::default()).unwrap());
    // Truncated in its last frame, and with a frame without attributes.
    let mut short = std::fs::read(&path).unwrap();
    let whole = short.len();
    short.truncate(whole - 20);
    std::fs::write(&path, &short).unwrap();
    assert!(read(&path, &Progress::default()).is_err());
    let mut object = multi_frame(&[0, 1, 2]);
    object.put(string(tags::NUMBER_OF_FRAMES, "4"));
    let path = put(folder.path(), "enhanced", object);
    let why = read(&path, &Progress::default()).unwrap_err().to_string();
    assert!(why.contains("says 4 frames and describes 3"), "{why}");
}

#[test]
fn unreadable_files_are_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |object: InMemDicomObject| {
        let path = put(folder.path(), "one.dcm", object);
        read(&path, &Progress::default()).unwrap_err().to_string()
    };
    let why = refused(image("2.25.14", pixels(0)));
    assert!(why.contains("does not give its position"), "{why}");
    let with = |element: DataElement<InMemDicomObject>| {
        let mut object = slice("2.25.14", 0);
        object.put(element);
        refused(object)
    };
    let why = with(string(tags::PHOTOMETRIC_INTERPRETATION, "RGB"));
    assert!(why.contains("RGB"), "{why}");
    let why = with(short(tags::BITS_ALLOCATED, 12));
    assert!(why.contains("12 bits"), "{why}");
    let why = with(short(tags::HIGH_BIT, 13));
    assert!(why.contains("up to bit 13"), "{why}");
    let why = with(decimals(tags::RESCALE_SLOPE, &[0.0]));
    assert!(why.contains("is 0"), "{why}");
    let nothing = tempfile::tempdir().unwrap();
    let why = read(nothing.path(), &Progress::default()).unwrap_err().to_string();
    assert!(why.contains("no DICOM image series"), "{why}");
}
