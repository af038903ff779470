//! Files written by hand, good and broken.

use crate::{FileError, LabelVolume, Progress};
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::path::{Path, PathBuf};

fn read(path: &Path, label: Option<u8>) -> Result<LabelVolume, FileError> {
    crate::read(path, label, &Progress::default())
}

struct Temp(PathBuf);

impl Drop for Temp {
    fn drop(&mut self) {
        let _removed = std::fs::remove_file(&self.0);
    }
}

fn file(name: &str, bytes: &[u8]) -> Temp {
    let path = std::env::temp_dir().join(format!("stylet-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    Temp(path)
}

fn header(dims: [u16; 3], datatype: i16, affine_mm: [[f32; 4]; 3]) -> Vec<u8> {
    let mut b = vec![0_u8; 352];
    let mut put = |at: usize, bytes: &[u8]| b[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348_i32.to_le_bytes());
    for (i, d) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &d.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &(if datatype == 16 { 32_i16 } else { 8 }).to_le_bytes());
    for i in 0..4 {
        put(76 + 4 * i, &1.0_f32.to_le_bytes());
    }
    put(108, &352.0_f32.to_le_bytes());
    put(123, &[2]);
    put(254, &1_i16.to_le_bytes());
    for (r, row) in affine_mm.iter().enumerate() {
        for (c, v) in row.iter().enumerate() {
            put(280 + 16 * r + 4 * c, &v.to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    b
}

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn small() -> Vec<u8> {
    let mut b = header([4, 4, 4], 2, IDENTITY);
    b.extend((0..64).map(|i| [0, 1, 1, 3][i % 4]));
    b
}

fn refused(name: &str, bytes: &[u8], expected: &str) {
    let temp = file(name, bytes);
    let why = read(&temp.0, None).expect_err(name).to_string();
    assert!(why.contains(expected), "{name}: {why}");
}

#[test]
fn every_broken_file_is_refused_with_its_reason() {
    let with = |at: usize, bytes: &[u8]| {
        let mut b = small();
        b[at..at + bytes.len()].copy_from_slice(bytes);
        b
    };
    refused("empty.nii", &[], "it is empty");
    refused("short.nii", &small()[..100], "truncated");
    refused("cut.nii", &small()[..400], "truncated");
    refused("magic.nii", &with(344, b"nope"), "magic");
    refused("pair.nii", &with(344, b"ni1\0"), ".hdr/.img");
    refused("type.nii", &with(70, &128_i16.to_le_bytes()), "data type is number 128");
    refused("nan.nii", &with(280, &f32::NAN.to_le_bytes()), "not a number");
    refused("shear.nii", &with(284, &0.2_f32.to_le_bytes()), "sheared");
    refused("zero.nii", &with(42, &0_u16.to_le_bytes()), "0 x 4 x 4");
    refused("rank.nii", &with(40, &2_u16.to_le_bytes()), "2 dimensions");
    refused("series.nii", &with(40, &[4, 0, 4, 0, 4, 0, 4, 0, 9, 0]), "series");
    refused(
        "huge.nii",
        &with(42, &[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]),
        "claims 32767",
    );
    refused("large.nii", &with(42, &[0, 1, 0, 1, 0, 1]), "requires 16777568 bytes");
    refused("offset.nii", &with(108, &f32::NAN.to_le_bytes()), "begin at byte NaN");
    refused(
        "none.nii",
        &header([4, 4, 4], 2, IDENTITY)
            .into_iter()
            .chain([0; 64])
            .collect::<Vec<_>>(),
        "every voxel is 0",
    );
    refused("nifti2.nii", &540_i32.to_le_bytes(), "NIfTI-2");
    refused("packed.nii", &[0x1f, 0x8b, 8, 0], "cannot be unpacked");
    refused("letter.nii", b"Dear colleague, enclosed", "format is not supported");
    refused("broken.nii.gz", &[0x1f, 0x8b, 8, 0, 1, 2, 3], "gz");
    let mut image = header([2, 1, 1], 16, IDENTITY);
    image.extend([1.0_f32, 17.25].iter().flat_map(|v| v.to_le_bytes()));
    refused("image.nii", &image, "17.25");
    assert!(
        read(Path::new("/no/such.nii"), None)
            .unwrap_err()
            .to_string()
            .contains("cannot be opened")
    );
}

#[test]
fn damaged_volumes_never_panic() {
    let good = small();
    for at in 0..352 {
        let mut b = good.clone();
        b[at] ^= 0xff;
        let temp = file("flip.nii", &b);
        let _answer = read(&temp.0, None);
        let temp = file("flip.nii", &good[..at]);
        assert!(read(&temp.0, None).is_err());
    }
}

#[test]
fn a_wrong_label_is_refused_with_the_valid_ones() {
    let temp = file("labels.nii", &small());
    let all = read(&temp.0, None).unwrap();
    assert_eq!(all.tissue_elements(), 48);
    assert_eq!(all.voxels_per_label, [(1, 32), (3, 16)]);
    assert_eq!(read(&temp.0, Some(3)).unwrap().tissue_elements(), 16);
    let why = read(&temp.0, Some(2)).unwrap_err().to_string();
    assert!(why.contains("1 (32 voxels), 3 (16 voxels)"), "{why}");
}

#[test]
fn slope_is_applied() {
    let mut b = small();
    b[112..116].copy_from_slice(&2.0_f32.to_le_bytes());
    let temp = file("slope.nii", &b);
    assert_eq!(read(&temp.0, None).unwrap().voxels_per_label, [(2, 32), (6, 16)]);
}

/// Tests an ellipsoid known in patient space, through an oblique frame with unequal sides,
/// right-handed and mirrored.
#[test]
fn an_oblique_gland_stays_where_it_is_in_the_patient() {
    let rotation = Rotation3::from_euler_angles(0.3, -0.5, 0.9);
    for mirror in [1.0, -1.0] {
        let side = [0.7, 0.9, 2.5];
        let directions: Matrix3<f64> = rotation.matrix() * Matrix3::from_diagonal(&Vector3::new(mirror, 1.0, 1.0));
        let columns = directions * Matrix3::from_diagonal(&Vector3::from(side));
        let dims = [80_u16, 70, 30];
        let truth = Vector3::new(12.0, -35.0, 48.0);
        let middle = Vector3::new(37.2, 33.9, 14.6);
        let origin = truth - columns * middle;
        let affine =
            [0, 1, 2].map(|r| [columns[(r, 0)], columns[(r, 1)], columns[(r, 2)], origin[r]].map(|v| v as f32));
        let mut bytes = header(dims, 2, affine);
        let mut inside = 0.0;
        for k in 0..dims[2] {
            for j in 0..dims[1] {
                for i in 0..dims[0] {
                    let at = columns * Vector3::new(f64::from(i), f64::from(j), f64::from(k)) + origin - truth;
                    let body = Vector3::new(at.x / 20.0, at.y / 15.0, at.z / 18.0);
                    let tissue = body.norm_squared() <= 1.0;
                    inside += f64::from(u8::from(tissue));
                    bytes.push(u8::from(tissue));
                }
            }
        }
        let temp = file("oblique.nii", &bytes);
        let v = read(&temp.0, None).unwrap();
        let p = v.patient.to_wire();
        let r = Matrix3::from_row_slice(&p[..9]);
        assert!((r.determinant() - 1.0).abs() < 1e-9 && (r * r.transpose() - Matrix3::identity()).amax() < 1e-9);
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for (index, _) in v.cells.iter().enumerate().filter(|(_, c)| **c != 0) {
            let at = [
                index % v.dims[0],
                index / v.dims[0] % v.dims[1],
                index / v.dims[0] / v.dims[1],
            ];
            sum += Vector3::from(at.map(|a| (a as f64 + 0.5) * v.spacing_m));
            count += 1.0;
        }
        let centroid_mm = (r * (sum / count) + Vector3::new(p[9], p[10], p[11])) * 1e3;
        let off = r.transpose() * (centroid_mm - truth);
        assert!((0..3).all(|a| off[a].abs() < side[a] / 2.0), "{off:?}");
        let volumes = count * (v.spacing_m * 1e3).powi(3) / (inside * side.iter().product::<f64>());
        assert!((volumes - 1.0).abs() < 0.03, "{volumes}");
    }
}

/// Guards against a silent choice between two orientations that differ.
#[test]
fn an_sform_that_differs_from_the_qform_is_reported_by_how_much() {
    let with_qform = |shift_mm: f32| {
        let mut b = small();
        b[252..254].copy_from_slice(&1_i16.to_le_bytes());
        b[268..272].copy_from_slice(&shift_mm.to_le_bytes());
        let temp = file(&format!("qform-{shift_mm}.nii"), &b);
        read(&temp.0, None).unwrap().warnings.join("; ")
    };
    let said = with_qform(4.5);
    assert!(said.contains("its sform and its qform differ, by 4.50 mm"), "{said}");
    let said = with_qform(0.0);
    assert!(!said.contains("qform"), "{said}");
}
