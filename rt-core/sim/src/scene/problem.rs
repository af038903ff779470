//! Problems of a scene, reported with the value, the limit and the remedy.

use super::{Layer, MAX_CELLS_PER_AXIS, MAX_ELEMENTS, MAX_STRUCTURES, SPACING_RANGE_M};
use stylet_settings::BUILTIN_SCENES;

const MIB: u64 = 1 << 20;

/// Why labels make no scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneProblem {
    /// An axis without cells.
    #[error("0 cells along {axis}, at least 1 needed: give the volume's size")]
    NoCells {
        /// x, y or z.
        axis: char,
    },
    /// More cells than a lattice can number.
    #[error(
        "{cells} cells along {axis}, at most {MAX_CELLS_PER_AXIS}: crop the volume or merge voxels into larger elements"
    )]
    TooManyCells {
        /// x, y or z.
        axis: char,
        /// Cells along it.
        cells: usize,
    },
    /// Not one label for each cell.
    #[error("{cells} labels for {} x {} x {} cells: give exactly one label for each cell", dims[0], dims[1], dims[2])]
    CellCount {
        /// Cells along x, y, z.
        dims: [usize; 3],
        /// Labels given.
        cells: usize,
    },
    /// An edge that is no edge of tissue.
    #[error(
        "spacing {spacing_m} m, must be from {} to {} m: check the unit (metres) or resample",
        SPACING_RANGE_M[0], SPACING_RANGE_M[1]
    )]
    Spacing {
        /// Edge of a cell, m.
        spacing_m: f64,
    },
    /// Layers that no body has around it.
    #[error(
        "layers around the body: at most {}, of {} to {} m and {} to {} Pa each",
        Layer::MOST, Layer::THICKNESS_M[0], Layer::THICKNESS_M[1], Layer::YOUNG_PA[0], Layer::YOUNG_PA[1]
    )]
    Layers,
    /// No tissue.
    #[error("0 elements, at least 1 needed: all labels are zero; label the tissue with a number other than zero")]
    Empty,
    /// More tissue than a tick can solve.
    #[error("{elements} elements, at most {MAX_ELEMENTS}: crop the tissue or merge voxels into larger elements")]
    TooManyElements {
        /// Cells with a label other than zero.
        elements: usize,
    },
    /// More memory than is free.
    #[error(
        "{elements} elements need {} MiB, {} MiB of memory are free: merge voxels into larger elements, or end other programs",
        needed_bytes.div_ceil(MIB), available_bytes / MIB
    )]
    Memory {
        /// Cells with a label other than zero.
        elements: usize,
        /// Bytes that they need.
        needed_bytes: u64,
        /// Bytes that the kernel has available.
        available_bytes: u64,
    },
    /// More structures than the protocol carries.
    #[error("{structures} structures, at most {MAX_STRUCTURES}: give several of them one label")]
    TooManyStructures {
        /// Structures given.
        structures: usize,
    },
    /// Label 0 is no tissue.
    #[error("structure \"{structure}\" has label 0, which is no tissue: give it a label from 1 to 255")]
    ZeroLabel {
        /// Its name.
        structure: String,
    },
    /// Two structures with one label.
    #[error("structures \"{}\" and \"{}\" both have label {label}: give each its own", structures[0], structures[1])]
    SameLabel {
        /// The label of both.
        label: u8,
        /// Their names.
        structures: [String; 2],
    },
    /// Cells whose label belongs to no structure.
    #[error("{cells} cells have label {label}, which no structure has: add the structure or clear the cells")]
    UnknownLabel {
        /// Their label.
        label: u8,
        /// Number of cells.
        cells: usize,
    },
    /// A structure without cells: empty, or outside the volume.
    #[error(
        "structure \"{structure}\" has no cell (label {label}): it is empty or lies outside the volume; leave it out or \
         enlarge the volume"
    )]
    NoCellOf {
        /// Its name.
        structure: String,
        /// Its label.
        label: u8,
    },
    /// A solid drawn by formula that leaves the volume.
    #[error(
        "structure \"{structure}\" reaches from {:.1} to {:.1} mm along {axis}, the volume from {:.1} to {:.1} mm: move it \
         inside",
        reach_m[0] * 1e3, reach_m[1] * 1e3, volume_m[0] * 1e3, volume_m[1] * 1e3
    )]
    Outside {
        /// Its name.
        structure: String,
        /// x, y or z.
        axis: char,
        /// Lowest and highest place of the solid along the axis, m.
        reach_m: [f64; 2],
        /// Lowest and highest place of the volume along the axis, m.
        volume_m: [f64; 2],
    },
    /// A number of a structure's material out of its range.
    #[error("structure \"{structure}\": {what} is {value}, must be {limit}")]
    Material {
        /// Its name.
        structure: String,
        /// Name of the value.
        what: String,
        /// Its value.
        value: f64,
        /// Values that would be accepted, in words.
        limit: &'static str,
    },
    /// Nothing can move.
    #[error("every structure is fixed: nothing can move; leave one of them free")]
    AllFixed,
}

/// Why there is no scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// No built-in scene has this name.
    #[error("no built-in scene \"{0}\": choose one of {known}", known = BUILTIN_SCENES.join(", "))]
    Unknown(String),
    /// A kept scene whose runs of labels do not fill its volume.
    #[error("the scene has {dims:?} cells in its header and {cells} in its runs")]
    RunCount {
        /// Cells along x, y, z.
        dims: [usize; 3],
        /// Cells of all runs.
        cells: u64,
    },
    /// Labels that make no scene.
    #[error("the scene has {} problem(s){}", .0.len(), lines(.0))]
    Invalid(Vec<SceneProblem>),
}

fn lines(problems: &[SceneProblem]) -> String {
    problems.iter().map(|problem| format!("\n  {problem}")).collect()
}
