//! What can be wrong with a scene, said with the value, the limit and what to do.

use std::fmt;

use super::{Labels, MAX_CELLS_PER_AXIS, MAX_ELEMENTS, MAX_STRUCTURES, SPACING_RANGE_M, Structure, material, memory};
use stylet_shm_schema::BUILTIN_SCENES;

#[derive(Clone, Debug, PartialEq)]
pub enum SceneProblem {
    NoCells {
        axis: char,
    },
    TooManyCells {
        axis: char,
        cells: usize,
    },
    CellCount {
        dims: [usize; 3],
        cells: usize,
    },
    Spacing {
        spacing_m: f64,
    },
    Empty,
    TooManyElements {
        elements: usize,
    },
    /// More than there is.
    Memory {
        elements: usize,
        needed_bytes: u64,
        available_bytes: u64,
    },
    TooManyStructures {
        structures: usize,
    },
    /// Label 0 is no tissue.
    ZeroLabel {
        structure: String,
    },
    SameLabel {
        label: u8,
        structures: [String; 2],
    },
    /// Cells whose label belongs to no structure.
    UnknownLabel {
        label: u8,
        cells: usize,
    },
    /// A structure without cells: empty, or outside the volume.
    NoCellOf {
        structure: String,
        label: u8,
    },
    /// A solid drawn by formula that leaves the volume; both along one axis.
    Outside {
        structure: String,
        axis: char,
        reach_m: [f64; 2],
        volume_m: [f64; 2],
    },
    /// A number of a structure's material out of its range.
    Material {
        structure: String,
        what: String,
        value: f64,
        limit: &'static str,
    },
    AllFixed,
}

impl fmt::Display for SceneProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const MIB: u64 = 1 << 20;
        match self {
            Self::NoCells { axis } => {
                write!(f, "0 cells along {axis}, at least 1 needed: give the volume's size")
            }
            Self::TooManyCells { axis, cells } => write!(
                f,
                "{cells} cells along {axis}, at most {MAX_CELLS_PER_AXIS}: crop the volume or merge voxels into larger elements"
            ),
            Self::CellCount { dims, cells } => write!(
                f,
                "{cells} labels for {} x {} x {} cells: give exactly one label for each cell",
                dims[0], dims[1], dims[2]
            ),
            Self::Spacing { spacing_m } => write!(
                f,
                "spacing {spacing_m} m, must be from {} to {} m: check the unit (metres) or resample",
                SPACING_RANGE_M[0], SPACING_RANGE_M[1]
            ),
            Self::Empty => write!(
                f,
                "0 elements, at least 1 needed: all labels are zero; label the tissue with a number other than zero"
            ),
            Self::TooManyElements { elements } => write!(
                f,
                "{elements} elements, at most {MAX_ELEMENTS}: crop the tissue or merge voxels into larger elements"
            ),
            Self::Memory {
                elements,
                needed_bytes,
                available_bytes,
            } => write!(
                f,
                "{elements} elements need {} MiB, {} MiB of memory are free: merge voxels into larger elements, or end other programs",
                needed_bytes.div_ceil(MIB),
                available_bytes / MIB
            ),
            Self::TooManyStructures { structures } => write!(
                f,
                "{structures} structures, at most {MAX_STRUCTURES}: give several of them one label"
            ),
            Self::ZeroLabel { structure } => write!(
                f,
                "structure \"{structure}\" has label 0, which is no tissue: give it a label from 1 to 255"
            ),
            Self::SameLabel { label, structures } => write!(
                f,
                "structures \"{}\" and \"{}\" both have label {label}: give each its own",
                structures[0], structures[1]
            ),
            Self::UnknownLabel { label, cells } => write!(
                f,
                "{cells} cells have label {label}, which no structure has: add the structure or clear the cells"
            ),
            Self::NoCellOf { structure, label } => write!(
                f,
                "structure \"{structure}\" has no cell (label {label}): it is empty or lies outside the volume; leave it out or enlarge the volume"
            ),
            Self::Outside {
                structure,
                axis,
                reach_m: [low, high],
                volume_m: [from, to],
            } => write!(
                f,
                "structure \"{structure}\" reaches from {:.1} to {:.1} mm along {axis}, the volume from {:.1} to {:.1} mm: move it inside",
                low * 1e3,
                high * 1e3,
                from * 1e3,
                to * 1e3
            ),
            Self::Material {
                structure,
                what,
                value,
                limit,
            } => write!(f, "structure \"{structure}\": {what} is {value}, must be {limit}"),
            Self::AllFixed => write!(f, "every structure is fixed: nothing can move; leave one of them free"),
        }
    }
}

/// Why there is no scene.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneError {
    Unknown(String),
    Invalid(Vec<SceneProblem>),
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(name) => {
                let known = BUILTIN_SCENES.join(", ");
                write!(f, "no built-in scene \"{name}\": choose one of {known}")
            }
            Self::Invalid(problems) => {
                write!(f, "the scene has {} problem(s)", problems.len())?;
                problems.iter().try_for_each(|problem| write!(f, "\n  {problem}"))
            }
        }
    }
}

impl std::error::Error for SceneProblem {}
impl std::error::Error for SceneError {}

pub(super) fn problems_of(labels: &Labels) -> Vec<SceneProblem> {
    let mut problems = Vec::new();
    for (axis, &cells) in ['x', 'y', 'z'].into_iter().zip(&labels.dims) {
        if cells == 0 {
            problems.push(SceneProblem::NoCells { axis });
        }
        if cells > MAX_CELLS_PER_AXIS {
            problems.push(SceneProblem::TooManyCells { axis, cells });
        }
    }
    let dims = labels.dims;
    let product = dims.iter().try_fold(1_usize, |product, &n| product.checked_mul(n));
    if product != Some(labels.cells.len()) {
        let cells = labels.cells.len();
        problems.push(SceneProblem::CellCount { dims, cells });
    }
    let [least, most] = SPACING_RANGE_M;
    if !(least..=most).contains(&labels.spacing_m) {
        let spacing_m = labels.spacing_m;
        problems.push(SceneProblem::Spacing { spacing_m });
    }
    let mut cells_of_label = [0_usize; 256];
    for &label in &labels.cells {
        cells_of_label[label as usize] += 1;
    }
    let elements = labels.cells.len() - cells_of_label[0];
    if elements == 0 {
        problems.push(SceneProblem::Empty);
    }
    if elements > MAX_ELEMENTS {
        problems.push(SceneProblem::TooManyElements { elements });
    }
    problems.extend(memory::problem(elements, labels.cells.len(), memory::available_bytes()));
    if !labels.structures.is_empty() {
        problems.extend(problems_of_structures(&labels.structures, &cells_of_label));
    }
    problems
}

fn problems_of_structures(structures: &[Structure], cells_of_label: &[usize; 256]) -> Vec<SceneProblem> {
    let mut problems = Vec::new();
    if structures.len() > MAX_STRUCTURES {
        let structures = structures.len();
        problems.push(SceneProblem::TooManyStructures { structures });
    }
    for (number, structure) in structures.iter().enumerate() {
        let (name, label) = (structure.name.clone(), structure.label);
        if let Some(earlier) = structures[..number].iter().find(|s| s.label == label) {
            let structures = [earlier.name.clone(), name.clone()];
            problems.push(SceneProblem::SameLabel { label, structures });
        }
        if label == 0 {
            problems.push(SceneProblem::ZeroLabel { structure: name });
        } else if cells_of_label[label as usize] == 0 {
            problems.push(SceneProblem::NoCellOf { structure: name, label });
        }
        problems.extend(material::problems_of(structure));
    }
    problems.extend(material::folding_between(structures));
    for (label, &cells) in (1..=255_u8).zip(&cells_of_label[1..]) {
        if cells > 0 && structures.iter().all(|s| s.label != label) {
            problems.push(SceneProblem::UnknownLabel { label, cells });
        }
    }
    if structures.iter().all(|s| s.material.fixed) {
        problems.push(SceneProblem::AllFixed);
    }
    problems
}

#[cfg(test)]
mod tests;
