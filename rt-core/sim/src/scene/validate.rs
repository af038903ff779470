//! Validation of labels as a scene: every problem at once.

use super::problem::SceneProblem;
use super::structure::Structure;
use super::{Labels, MAX_CELLS_PER_AXIS, MAX_ELEMENTS, MAX_STRUCTURES, SPACING_RANGE_M, material, memory};

/// Returns everything wrong with `labels`.
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
