//! RT Dose: a dose grid along the patient's axes, and the histograms of structures in it.

mod kind;
mod read;
mod write;

pub use kind::DoseKind;
#[cfg(test)]
pub(super) use read::of;
pub use read::{ReadDose, of_file, of_volume};
pub use write::bytes;

use super::Identity;

/// Dose, x fastest; centre of the first voxel and spacing (RAS, m).
pub struct DoseImage<'a> {
    /// Number of voxels along x, y, z.
    pub dims: [usize; 3],
    /// Centre of the first voxel (RAS), in m.
    pub origin_m: [f64; 3],
    /// Sides of a voxel, in m.
    pub spacing_m: [f64; 3],
    /// Dose of each voxel, in Gy, x fastest.
    pub dose_gy: &'a [f64],
    /// Type and summation.
    pub kind: &'a DoseKind,
}

/// References of a dose.
pub struct DoseOf<'a> {
    /// SOP instance UID of the dose itself.
    pub uid: &'a str,
    /// Patient, study and frame of reference.
    pub identity: &'a Identity,
    /// SOP instance UID of the RT Plan.
    pub plan: &'a str,
    /// SOP instance UID of the structure set of the histograms.
    pub structure_set: Option<&'a str>,
    /// Histograms of its structures.
    pub histograms: &'a [Histogram],
}

/// Cumulative histogram: the volume with at least a dose.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Number of the structure in its structure set.
    pub structure: usize,
    /// Width of a bin, in Gy.
    pub bin_gy: f64,
    /// Volume with at least the dose at which each bin begins, in m³.
    pub at_least_m3: Vec<f64>,
    /// Lowest, mean and highest dose, in Gy.
    pub range_gy: [f64; 3],
}

#[cfg(test)]
mod tests;
