//! The image under a segmentation, or another of the same patient: greys for the slices.

use super::bytes::{data_file, file_name, whole};
use super::dicom::{images, series};
use super::element::Sink;
use super::error::{ContentError, FileError, invalid};
use super::frame::VoxelFrame;
use super::open::Format;
use super::volume::VoxelValues;
use super::{Progress, metaimage, nifti, nrrd};
use nalgebra::Vector3;
use std::path::Path;
use stylet_anatomy::PatientFrame;

/// Percentiles shown as black and white, so that a few bright voxels do not darken the rest.
const BLACK_WHITE: [f64; 2] = [0.005, 0.995];
/// Number of voxels sampled for the range of greys.
const SAMPLED: usize = 1 << 20;

/// Greys on the voxels of a file, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Name of the file.
    pub name: String,
    /// Number of voxels along each axis.
    pub dims: [usize; 3],
    /// One grey for each voxel, 0 black to 255 white.
    pub greys: Vec<u8>,
    /// Values shown as black and white.
    pub range: [f32; 2],
    /// Place of the voxels in the patient.
    pub frame: VoxelFrame,
}

impl Image {
    /// Reads an image of any format, or the DICOM series in a folder; the error names the file.
    pub fn read(path: &Path, progress: &Progress) -> Result<Self, FileError> {
        let values = read_values(path, progress)?;
        Self::of(values, file_name(path)).map_err(|why| FileError::of(path, why))
    }

    fn of(voxels: VoxelValues<f32>, name: String) -> Result<Self, ContentError> {
        let [low, high] = range(&voxels.values)?;
        let grey = |value: &f32| ((value - low) / (high - low) * 255.0).round().clamp(0.0, 255.0) as u8;
        Ok(Self {
            name,
            dims: voxels.dims,
            greys: voxels.values.iter().map(grey).collect(),
            range: [low, high],
            frame: voxels.frame,
        })
    }

    /// Returns rows that map a place in the scene (m) and 1 to the place in the voxels, 0 to 1 from
    /// face to face along each axis.
    pub fn texture_from_scene(&self, patient: &PatientFrame) -> [[f64; 4]; 3] {
        let turn = patient.rotation();
        let origin = patient.translation_m() - self.frame.origin_m;
        [0, 1, 2].map(|a| {
            let along = self.frame.directions.column(a) / self.frame.spacing_m[a];
            let row = turn.transpose() * along;
            let sides = self.dims[a] as f64;
            [
                row.x / sides,
                row.y / sides,
                row.z / sides,
                (along.dot(&origin) + 0.5) / sides,
            ]
        })
    }

    /// Checks that the centre of the gland (scene, m) lies in the image; the error gives its
    /// distance from it.
    pub fn covers(&self, patient: &PatientFrame, middle_m: [f64; 3]) -> Result<(), ContentError> {
        let beside_m = self.distance_m(patient, middle_m);
        if beside_m == 0.0 {
            return Ok(());
        }
        Err(invalid!(
            "it ends {:.0} mm before the middle of the gland; is it of this patient, and in the same frame?",
            beside_m * 1e3
        ))
    }

    /// Returns the distance of a place in the scene from the image (m); 0 inside.
    fn distance_m(&self, patient: &PatientFrame, place_m: [f64; 3]) -> f64 {
        let rows = self.texture_from_scene(patient);
        let beyond = Vector3::from([0, 1, 2].map(|a| {
            let at: f64 = (0..3).map(|i| rows[a][i] * place_m[i]).sum::<f64>() + rows[a][3];
            (at - at.clamp(0.0, 1.0)) * self.dims[a] as f64 * self.frame.spacing_m[a]
        }));
        beyond.norm()
    }
}

/// Reads the values of an image unchanged, from a file or a folder's DICOM series, such as
/// Hounsfield units; the error names the file.
pub fn read_values(path: &Path, progress: &Progress) -> Result<VoxelValues<f32>, FileError> {
    if path.is_dir() || images::begins_as_dicom(path) {
        return series::read(path, progress);
    }
    read_volume(path, Sink::greys(progress), progress)
}

/// Reads the values of a volume in one file that is not DICOM; the error names the file.
pub fn read_volume<V>(path: &Path, sink: Sink<V>, progress: &Progress) -> Result<VoxelValues<V>, FileError> {
    let refused = |why: ContentError| FileError::of(path, why);
    let bytes = whole(path, progress).map_err(refused)?;
    let data = |name: &str| data_file(path, name, progress);
    let values = match Format::of(&bytes) {
        Some(Format::Nrrd) => nrrd::read_image(&bytes, &data, sink),
        Some(Format::Nifti) => nifti::read(&bytes, sink),
        Some(Format::MetaImage) => metaimage::read(&bytes, &data, sink),
        Some(Format::Dicom) | None => Err(
            "its format is not supported for images; supported are a DICOM series (its folder, or a file of it), NIfTI-1 (.nii, .nii.gz), NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd)"
                .into(),
        ),
    };
    values.map_err(refused)
}

/// Returns the values for black and white; ignores NaN.
fn range(values: &[f32]) -> Result<[f32; 2], ContentError> {
    let every = values.len().div_ceil(SAMPLED).max(1);
    let mut some: Vec<f32> = values
        .iter()
        .step_by(every)
        .copied()
        .filter(|v| v.is_finite())
        .collect();
    some.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| some.get((share * some.len().saturating_sub(1) as f64).round() as usize);
    let [low, high] = BLACK_WHITE.map(|share| at(share).copied());
    // A mask has few bright voxels: then all of the range is shown.
    let whole = [some.first().copied(), some.last().copied()];
    for [low, high] in [[low, high], whole] {
        if let (Some(low), Some(high)) = (low, high)
            && high > low
        {
            return Ok([low, high]);
        }
    }
    Err("all its voxels have the same value, so there is nothing to show".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn oblique() -> VoxelFrame {
        let (s, c) = 0.4_f64.sin_cos();
        let turn = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, -1.0);
        let columns = turn * Matrix3::from_diagonal(&Vector3::new(0.4e-3, 0.5e-3, 0.9e-3));
        VoxelFrame::new(columns, Vector3::new(-0.02, 0.31, 0.08), "test").unwrap()
    }

    fn image(dims: [usize; 3], value: impl Fn([usize; 3]) -> f32) -> Image {
        let at = |n: usize| [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
        let values = (0..dims.iter().product()).map(|n| value(at(n))).collect();
        let frame = oblique();
        Image::of(VoxelValues { dims, values, frame }, "test".to_owned()).unwrap()
    }

    /// Compares with the frame of the file, voxel by voxel.
    #[test]
    fn voxel_centres_are_found_from_the_scene() {
        let image = image([7, 5, 4], |at| at[0] as f32);
        let (s, c) = (-1.1_f64).sin_cos();
        let turn = Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c);
        let shift = Vector3::new(0.01, -0.2, 0.05);
        let patient = PatientFrame::new(turn, shift);
        let rows = image.texture_from_scene(&patient);
        for index in [[0, 0, 0], [6, 4, 3], [2, 3, 1], [5, 0, 2]] {
            let in_patient = image.frame.place_m(index.map(|i| i as f64));
            let in_scene = turn.transpose() * (in_patient - shift);
            for a in 0..3 {
                let found = (0..3).map(|i| rows[a][i] * in_scene[i]).sum::<f64>() + rows[a][3];
                let expected = (index[a] as f64 + 0.5) / image.dims[a] as f64;
                assert!(
                    (found - expected).abs() < 1e-9,
                    "{index:?}: {found} along {a}, not {expected}"
                );
            }
            assert_eq!(image.distance_m(&patient, in_scene.into()), 0.0);
        }
        let above = image.frame.place_m([3.0, 2.0, 3.5 + 10.0]);
        let far = image.distance_m(&patient, (turn.transpose() * (above - shift)).into());
        assert!((far - 10.0 * 0.9e-3).abs() < 1e-9, "{far}");
    }

    #[test]
    fn greys_span_most_voxels_and_nan_is_black() {
        let ramp = image([100, 10, 10], |at| match at {
            [0, 0, 0] => 1e9,
            [1, 0, 0] => f32::NAN,
            [x, ..] => x as f32 - 50.0,
        });
        assert_eq!((ramp.greys[0], ramp.greys[1]), (255, 0));
        let [low, high] = ramp.range;
        assert!(
            (-50.0..-48.0).contains(&low) && (48.0..50.0).contains(&high),
            "{low} to {high}"
        );
        let middle = ramp.greys[150];
        assert!((126..=130).contains(&middle), "{middle}");
        // One bright voxel of a thousand is the only content.
        let mask = image([10, 10, 10], |at| f32::from(at == [4, 4, 4]));
        assert_eq!(mask.greys.iter().filter(|&&g| g == 255).count(), 1);
    }

    #[test]
    fn an_image_of_nothing_is_refused() {
        for value in [3.0, f32::NAN] {
            let voxels = VoxelValues {
                dims: [2, 2, 2],
                values: vec![value; 8],
                frame: oblique(),
            };
            assert!(
                Image::of(voxels, String::new())
                    .unwrap_err()
                    .to_string()
                    .contains("nothing to show")
            );
        }
    }
}
