//! What a session runs on: a body of cubic elements and its surface, from labels or built in.
//!
//! Scene frame: axes along the lattice, metres; the centre of cell (i, j, k) is at
//! ((i + 0.5) h, (j + 0.5) h, (k + 0.5) h).

use std::sync::Arc;

mod builtin;
mod lattice;
mod problem;
mod source;
mod structure;
mod surface;
#[cfg(test)]
pub(crate) mod test_bodies;

pub use lattice::Lattice;
pub(crate) use lattice::Run;
pub use problem::{SceneError, SceneProblem};
pub use source::SceneSource;
pub use structure::{Material, Structure};
pub use surface::{Surface, surface_elements};

/// Most cells along one axis.
pub const MAX_CELLS_PER_AXIS: usize = 1024;
/// Most elements in a scene.
pub const MAX_ELEMENTS: usize = 4_000_000;
/// Smallest and largest edge of an element.
pub const SPACING_RANGE_M: [f64; 2] = [1e-4, 1e-2];

/// A label volume of cubic cells, x fastest; any label but zero is tissue, of the structure with that label.
#[derive(Clone, Debug)]
pub struct Labels {
    pub dims: [usize; 3],
    pub spacing_m: f64,
    pub cells: Vec<u8>,
    /// Empty: all tissue is one structure.
    pub structures: Vec<Structure>,
}

/// A body at rest.
#[derive(Clone, Debug)]
pub struct Scene {
    pub name: String,
    /// At least one; elements know theirs by its place here (`Lattice::structure`).
    pub structures: Vec<Structure>,
    /// Shared with the tissue model, which would otherwise hold a copy.
    pub lattice: Arc<Lattice>,
    pub surface: Surface,
}

impl Scene {
    /// Names of the scenes that need no file.
    pub const BUILTIN: [&'static str; 1] = ["paper"];

    /// A scene that needs no file.
    pub fn builtin(name: &str) -> Result<Scene, SceneError> {
        let labels = match name {
            "paper" => builtin::paper(),
            _ => return Err(SceneError::Unknown(name.to_owned())),
        };
        Scene::from_labels(name, &labels).map_err(SceneError::Invalid)
    }

    /// Cuts the lattice from labels, or lists every problem with them. Disconnected parts are allowed.
    pub fn from_labels(name: &str, labels: &Labels) -> Result<Scene, Vec<SceneProblem>> {
        let problems = problem::problems_of(labels);
        if !problems.is_empty() {
            return Err(problems);
        }
        let structures = match labels.structures.as_slice() {
            [] => vec![Structure::soft("tissue", 1)],
            several => several.to_vec(),
        };
        let lattice = Lattice::from_checked_labels(labels);
        let surface = Surface::of(&lattice);
        Ok(Scene {
            name: name.to_owned(),
            structures,
            lattice: Arc::new(lattice),
            surface,
        })
    }
}
