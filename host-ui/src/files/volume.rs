//! A segmented volume as the core takes it: cubic elements on the lattice of the scene frame.

/// Element (i, j, k) has its centre at ((i + 0.5) h, (j + 0.5) h, (k + 0.5) h), x fastest; every cell but 0 is tissue.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelVolume {
    pub dims: [usize; 3],
    pub spacing_m: f64,
    pub cells: Vec<u8>,
    /// Patient (RAS, m) from scene: row-major rotation, then translation.
    pub patient_from_scene: [f64; 12],
    pub name: String,
    /// Every label of the file with its number of voxels, by label.
    pub voxels_per_label: Vec<(u8, u64)>,
    /// What the user should know about how the file was read.
    pub warnings: Vec<String>,
}
