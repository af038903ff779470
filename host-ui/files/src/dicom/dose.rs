//! RT Dose: a dose grid along the patient's axes, and the histograms of structures in it.

mod read;
mod write;

pub use read::{ReadDose, of_file};
pub use write::bytes;

use super::Identity;

/// Dose of x fastest; the middle of the first voxel and the steps between them (RAS, m).
pub struct DoseImage<'a> {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Middle of the first voxel (RAS), in m.
    pub origin_m: [f64; 3],
    /// Sides of a voxel, in m.
    pub spacing_m: [f64; 3],
    /// Dose of each voxel, in Gy, x fastest.
    pub dose_gy: &'a [f64],
}

/// What a dose belongs to.
pub struct DoseOf<'a> {
    /// SOP instance UID of the dose itself.
    pub uid: &'a str,
    /// Patient, study and frame of reference.
    pub identity: &'a Identity,
    /// SOP instance UID of the RT Plan.
    pub plan: &'a str,
    /// SOP instance UID of the structure set that the histograms are of.
    pub structure_set: Option<&'a str>,
    /// Histograms of its structures.
    pub histograms: &'a [Histogram],
}

/// Cumulative: the volume that gets at least a dose.
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
