//! The grid of planes of which only some are in the file: those without a structure are left out.

use super::{Grid, ROUNDED_MM, SAME_PLANE_MM, Slice, UNEVEN, grid, name};
use crate::error::{ContentError, invalid};
use dicom_dictionary_std::tags;

/// Most planes of a grid.
const MAX_PLANES: f64 = 4096.0;
/// Largest deviation of a thickness from the distance of the planes, as a share of it.
const THICKNESS: f64 = 0.02;

/// Grid of planes, and the place of each frame in it.
pub struct Sparse {
    /// The whole grid.
    pub grid: Grid,
    /// Plane of each frame, in the order of the frames.
    pub planes: Vec<usize>,
    /// Remarks on the distance of the planes.
    pub notes: Vec<String>,
}

/// Returns the grid of frames, several of which may be of one plane; `between_mm` is the distance of
/// the planes, `thickness_mm` their thickness, if the file gives them.
pub fn sparse(frames: &[Slice], between_mm: Option<f64>, thickness_mm: Option<f64>) -> Result<Sparse, ContentError> {
    let first = frames.first().ok_or("it has no frames")?;
    let near = |slice: &Slice, a: usize| (slice.steps[a] - first.steps[a]).norm() < 1e-3 * first.steps[a].norm();
    if !frames.iter().all(|slice| near(slice, 0) && near(slice, 1)) {
        return Err("its frames differ in spacing or orientation; export one series".into());
    }
    let normal = first
        .normal()
        .try_normalize(1e-9)
        .ok_or("its frames have no orientation")?;
    let height = |slice: &Slice| slice.corner.dot(&normal);
    let mut heights: Vec<f64> = frames.iter().map(height).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| (*a - *b).abs() < SAME_PLANE_MM);
    let (lowest, range) = (heights[0], heights[heights.len() - 1] - heights[0]);
    let smallest = heights.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    let of_planes = (heights.len() > 1).then_some(smallest);
    let attribute = name(tags::SPACING_BETWEEN_SLICES);
    let mut notes = Vec::new();
    let step = match (between_mm, of_planes, thickness_mm) {
        (Some(between), ..) => between,
        (None, Some(smallest), Some(thick)) if (thick - smallest).abs() <= THICKNESS * smallest => smallest,
        (None, Some(smallest), _) => {
            notes.push(format!(
                "{attribute} is missing: the smallest distance of its planes is taken, {smallest:.3} mm"
            ));
            smallest
        }
        (None, None, Some(thick)) => {
            notes.push(format!(
                "{attribute} is missing: its plane is {thick:.3} mm thick by its SliceThickness"
            ));
            thick
        }
        (None, None, None) => return Err(invalid!("it has one plane, and {attribute} is missing")),
    };
    // NaN compares false.
    if !(step > SAME_PLANE_MM && range / step < MAX_PLANES) {
        return Err(invalid!(
            "{attribute} is {step} mm, and its planes range over {range:.1} mm; at most {MAX_PLANES} planes are read"
        ));
    }
    let last = (range / step).round();
    // The positions have more digits than the distance.
    let step = if last > 0.0 { range / last } else { step };
    let index = |slice: &Slice| ((height(slice) - lowest) / step).round() as usize;
    let top = frames.iter().max_by_key(|slice| index(slice)).unwrap_or(first);
    let bottom = frames.iter().min_by_key(|slice| index(slice)).unwrap_or(first);
    let across = if last > 0.0 {
        (top.corner - bottom.corner) / last
    } else {
        normal * step
    };
    let most_off = frames
        .iter()
        .map(|slice| (slice.corner - bottom.corner - across * index(slice) as f64).norm());
    let most_off = most_off.fold(0.0, f64::max);
    if most_off > (UNEVEN * step).max(ROUNDED_MM) || of_planes.is_some_and(|smallest| smallest < 0.5 * step) {
        return Err(invalid!(
            "its planes do not lie at multiples of {step:.3} mm ({attribute}), off by up to {most_off:.3} mm"
        ));
    }
    if of_planes.is_some_and(|smallest| smallest > 1.5 * step) {
        notes.push(format!(
            "no two of its planes are next to each other: {attribute} is {step:.3} mm, their smallest distance {smallest:.3} mm"
        ));
    }
    let planes: Vec<usize> = frames.iter().map(index).collect();
    // One plane more where there is one, because a grid has at least two.
    let all = (0..=last.max(1.0) as usize).map(|k| Slice {
        corner: bottom.corner + across * k as f64,
        ..first.clone()
    });
    let grid = grid(all.collect())?;
    let mut grid = grid.ok_or("it has no planes")?;
    grid.dims[2] = last as usize + 1;
    Ok(Sparse { grid, planes, notes })
}
