//! What can be wrong with a scene, said with the value, the limit and what to do.

use std::fmt;

use super::{Labels, MAX_CELLS_PER_AXIS, MAX_ELEMENTS, SPACING_RANGE_M, Scene};

#[derive(Clone, Debug, PartialEq)]
pub enum SceneProblem {
    NoCells { axis: char },
    TooManyCells { axis: char, cells: usize },
    CellCount { dims: [usize; 3], cells: usize },
    Spacing { spacing_m: f64 },
    Empty,
    TooManyElements { elements: usize },
}

impl fmt::Display for SceneProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
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
                let known = Scene::BUILTIN.join(", ");
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
    let elements = labels.cells.iter().filter(|&&label| label != 0).count();
    if elements == 0 {
        problems.push(SceneProblem::Empty);
    }
    if elements > MAX_ELEMENTS {
        problems.push(SceneProblem::TooManyElements { elements });
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_problem_is_listed_at_once() {
        let labels = Labels {
            dims: [0, 2000, 3],
            spacing_m: f64::NAN,
            cells: vec![0; 5],
            structures: Vec::new(),
        };
        let problems = Scene::from_labels("bad", &labels).expect_err("five problems");
        assert_eq!(problems.len(), 5);
        let text = SceneError::Invalid(problems).to_string();
        for part in ["along x", "2000", "1024", "5 labels", "NaN", "0 elements"] {
            assert!(text.contains(part), "{part} not in: {text}");
        }
    }

    #[test]
    fn too_many_elements_are_refused_by_number() {
        let dims = [200, 200, 101];
        let labels = Labels {
            dims,
            spacing_m: 1e-3,
            cells: vec![1; dims.iter().product()],
            structures: Vec::new(),
        };
        let problems = Scene::from_labels("large", &labels).expect_err("too many");
        let elements = 4_040_000;
        assert_eq!(problems, [SceneProblem::TooManyElements { elements }]);
    }

    #[test]
    fn unknown_scene_names_the_known_ones() {
        let error = Scene::builtin("papper").expect_err("not a scene");
        assert!(error.to_string().contains("paper"));
    }
}
