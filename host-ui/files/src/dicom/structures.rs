//! RT Structure Set: named contours, as a label volume on the grid of their images.

mod cells;
mod contours;
mod outline;
mod overlaps;
mod planes;
mod raster;
mod reach;
mod rois;
mod solid;
pub mod write;

use super::super::element::{short, voxel_count};
use super::super::frame::VoxelFrame;
use super::super::overlap::with_warning;
use super::super::volume::Voxels;
use super::Identity;
use super::checked::Object;
use super::images::{self, Grid};
use super::values::{items, needed, text};
use crate::error::{ContentError, invalid};
use contours::Drawn;
use dicom_dictionary_std::{tags, uids};
use dicom_object::InMemDicomObject;
use nalgebra::{Matrix3, Vector3};
use rois::Rois;
pub use solid::Solid;
use std::path::Path;

const MAX_STRUCTURES: usize = 255;
/// Side of a voxel without images. For contours that do not run along cells, the cell sides are
/// divided into parts of at most this length.
const SIDE_M: f64 = 0.5e-3;
/// Distance beyond which contours are of different planes.
const SAME_PLANE_M: f64 = 0.05e-3;

/// Closed contours of one structure; corners in RAS, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Contoured {
    /// Name of the structure.
    pub name: String,
    /// Contours, each a closed polygon.
    pub contours: Vec<Vec<Vector3<f64>>>,
}

impl Contoured {
    /// Returns the unit vector across the plane of its largest contour.
    fn normal(&self) -> Result<Vector3<f64>, ContentError> {
        let normal = normal_of(self.contours.iter());
        normal.ok_or_else(|| invalid!("the contours of {} enclose no area", short(&self.name)))
    }

    /// Returns the smallest distance between two of its planes, m; infinite for one plane.
    fn plane_distance_m(&self) -> Result<f64, ContentError> {
        let normal = self.normal()?;
        let mut heights: Vec<f64> = self.contours.iter().map(|c| c[0].dot(&normal)).collect();
        heights.sort_by(f64::total_cmp);
        let gaps = heights.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > SAME_PLANE_M);
        Ok(gaps.fold(f64::INFINITY, f64::min))
    }
}

/// Contours of an RT Structure Set.
#[derive(Clone, Debug, PartialEq)]
pub struct StructureSet {
    /// Structures that have a volume.
    pub structures: Vec<Contoured>,
    /// Series and single images that it was drawn on.
    pub series: Vec<String>,
    /// SOP instance UIDs of single images that it was drawn on.
    pub images: Vec<String>,
    /// Omissions, with reasons.
    pub notes: Vec<String>,
}

/// Returns the unit vector across the plane of the largest contour.
fn normal_of<'a>(contours: impl Iterator<Item = &'a Vec<Vector3<f64>>>) -> Option<Vector3<f64>> {
    let areas = contours.map(|c| area_vector(c));
    let largest = areas.max_by(|a, b| a.norm().total_cmp(&b.norm()));
    largest.and_then(|area| area.try_normalize(1e-12))
}

/// Returns whether contours of one plane are nested, so that the inner ones are holes.
fn nested(contours: &[Vec<Vector3<f64>>]) -> bool {
    let Some(normal) = normal_of(contours.iter()) else {
        return false;
    };
    let planes = planes::flat(contours, &planes::axes_of(normal));
    planes
        .iter()
        .any(|(_, polygons)| polygons.len() > planes::MOST_NESTED || planes::depths(polygons).any(|depth| depth > 0))
}

/// Reads a structure set and the images in its folder.
pub fn read(object: &Object, folder: &Path) -> Result<Voxels, ContentError> {
    let mut set = StructureSet::of(object)?;
    let (slices, notes) = images::find(folder, &set.series, &set.images, &Identity::of(object))?;
    set.notes.extend(notes);
    set.voxels(images::grid(slices)?)
}

impl StructureSet {
    /// Reads the structures of a DICOM object; the error lists every problem.
    pub fn of(object: &Object) -> Result<Self, ContentError> {
        if object.sop_class != uids::RT_STRUCTURE_SET_STORAGE {
            return Err(invalid!(
                "it is DICOM of another kind (SOP class {}); structures are in an RT Structure Set or a Segmentation",
                short(&object.sop_class)
            ));
        }
        let data = &object.data;
        let rois = Rois::of(data)?;
        let (mut drawn, mut notes, mut problems) = (Vec::<Drawn>::new(), Vec::new(), Vec::new());
        for item in items(data, tags::ROI_CONTOUR_SEQUENCE) {
            let number = needed(item, tags::REFERENCED_ROI_NUMBER, -2e9, 2e9)?;
            match Drawn::of(item, number, rois.name(number, &mut notes)) {
                Ok(one) => match drawn.iter_mut().find(|other| other.number == number) {
                    Some(other) => notes.extend(other.and(one)),
                    None => drawn.push(one),
                },
                Err(why) => problems.push(why.to_string()),
            }
        }
        ContentError::all(problems)?;
        let mut structures = Vec::new();
        for one in drawn {
            let (structure, remarks) = one.tidied();
            notes.extend(remarks);
            structures.extend(structure);
        }
        notes.extend(rois::same_names(&structures));
        if structures.is_empty() {
            let why = if notes.is_empty() {
                "there are no contours".to_owned()
            } else {
                notes.join("; ")
            };
            return Err(invalid!("it contains no structure with a volume: {why}"));
        }
        if structures.len() > MAX_STRUCTURES {
            return Err(invalid!(
                "it contains {} structures; at most {MAX_STRUCTURES} are supported",
                structures.len()
            ));
        }
        let (series, images) = references(data);
        Ok(Self {
            structures,
            series,
            images,
            notes,
        })
    }

    /// Returns the voxels on the grid of the images, or else on one around the contours.
    pub fn voxels(self, grid: Option<Grid>) -> Result<Voxels, ContentError> {
        let mut notes = self.notes.clone();
        let of_images = grid.clone();
        let grid = match grid {
            Some(grid) => reach::continued(grid, &self.structures)?,
            None => {
                let grid = self.grid_around()?;
                notes.push(format!(
                    "its images are not in its folder: a grid of {} in the plane of the contours is used",
                    in_mm(&grid.frame)
                ));
                grid
            }
        };
        let (labels, lost) = raster::labels(&self.structures, &grid)?;
        notes.extend(lost);
        notes.extend(of_images.and_then(|images| reach::beyond(&images, &grid, &labels, &self.structures)));
        let names = (1_u8..=255).zip(self.structures.into_iter().map(|s| s.name)).collect();
        let voxels = Voxels {
            dims: grid.dims,
            labels,
            frame: grid.frame,
            names,
            also: Vec::new(),
            overlap: None,
        };
        Ok(with_warning(voxels, (!notes.is_empty()).then(|| notes.join("; "))))
    }

    /// Returns a grid two voxels larger than all contours on each side; the faces of its voxels,
    /// not their centres, lie along the outermost contours.
    fn grid_around(&self) -> Result<Grid, ContentError> {
        let points = || self.structures.iter().flat_map(|s| s.contours.iter().flatten());
        let normal =
            normal_of(self.structures.iter().flat_map(|s| &s.contours)).ok_or("its contours enclose no area")?;
        // Along the patient's axes if the planes allow it.
        let right = (Vector3::x() - normal * normal.x).try_normalize(0.5);
        let across = right
            .or((Vector3::y() - normal * normal.y).try_normalize(0.5))
            .unwrap_or(Vector3::z());
        let across = (across - normal * across.dot(&normal)).normalize();
        let axes = Matrix3::from_columns(&[across, normal.cross(&across), normal]);
        let step_m = self.plane_distance_m()?;
        let along = |a: usize| points().map(move |p| axes.column(a).dot(p));
        let side_m = |a: usize| match cells::pitch_m(along(a)) {
            Some(pitch_m) => pitch_m / (pitch_m / SIDE_M).ceil(),
            None => SIDE_M,
        };
        let sides = [side_m(0), side_m(1), step_m];
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for p in points() {
            let along = axes.transpose() * p;
            (low, high) = (low.inf(&along), high.sup(&along));
        }
        // Planes lie in the centres of their voxels.
        let half = Vector3::new(sides[0], sides[1], 0.0) / 2.0;
        let margin = Vector3::new(2.0 * sides[0], 2.0 * sides[1], step_m);
        let first = low - margin + half;
        let dims = [0, 1, 2].map(|a| ((high[a] + margin[a] - half[a] - first[a]) / sides[a] - 1e-6).ceil() as u64 + 1);
        voxel_count(&dims)?;
        let columns = axes * Matrix3::from_diagonal(&Vector3::from(sides));
        Ok(Grid {
            dims: dims.map(|d| d as usize),
            frame: VoxelFrame::new(columns, axes * first, "contours")?,
        })
    }

    /// Returns the smallest distance between two planes of one structure.
    fn plane_distance_m(&self) -> Result<f64, ContentError> {
        let mut smallest = f64::INFINITY;
        for structure in &self.structures {
            smallest = structure.plane_distance_m()?.min(smallest);
        }
        if smallest.is_finite() {
            return Ok(smallest);
        }
        Err(
            "each of its structures has contours in one plane only, so none has a thickness; put its images in its folder"
                .into(),
        )
    }
}

/// Formats the sides of the voxels of a slice.
fn in_mm(frame: &VoxelFrame) -> String {
    let [x, y] = [0, 1].map(|a| format!("{:.2}", frame.spacing_m[a] * 1e3));
    if x == y {
        format!("{x} mm")
    } else {
        format!("{x} x {y} mm")
    }
}

/// Returns the normal to the plane of a polygon, as long as its area (m2).
fn area_vector(corners: &[Vector3<f64>]) -> Vector3<f64> {
    let next = corners.iter().cycle().skip(1);
    let origin = corners[0];
    corners
        .iter()
        .zip(next)
        .map(|(a, b)| (a - origin).cross(&(b - origin)))
        .sum::<Vector3<f64>>()
        / 2.0
}

fn references(data: &InMemDicomObject) -> (Vec<String>, Vec<String>) {
    let (mut series_uids, mut images) = (Vec::new(), Vec::new());
    let frames = items(data, tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE).iter();
    let studies = frames.flat_map(|f| items(f, tags::RT_REFERENCED_STUDY_SEQUENCE));
    for series in studies.flat_map(|s| items(s, tags::RT_REFERENCED_SERIES_SEQUENCE)) {
        series_uids.extend(text(series, tags::SERIES_INSTANCE_UID));
        let of_series = items(series, tags::CONTOUR_IMAGE_SEQUENCE);
        images.extend(
            of_series
                .iter()
                .filter_map(|i| text(i, tags::REFERENCED_SOP_INSTANCE_UID)),
        );
    }
    (series_uids, images)
}

#[cfg(test)]
mod tests;
