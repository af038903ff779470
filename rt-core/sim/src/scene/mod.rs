//! Scene of a session: a body of cubic elements and its surface, from labels or built in.
//!
//! Scene frame: axes along the lattice, metres; the centre of cell (i, j, k) is at ((i + 0.5) h, (j + 0.5) h, (k + 0.5)
//! h).

use std::sync::Arc;

mod builtin;
mod grids;
mod lattice;
mod material;
mod memory;
mod problem;
mod source;
mod structure;
mod surface;
#[cfg(test)]
pub(crate) mod test_bodies;
mod tissue_kind;
mod validate;

pub use grids::{NodeGrid, label_grid};
pub(crate) use lattice::Run;
pub use lattice::{Extent, Lattice};
pub use problem::{SceneError, SceneProblem};
pub use source::SceneSource;
pub use structure::{Layer, Material, Role, Structure, Surroundings};
pub use stylet_settings::MAX_STRUCTURES;
pub use surface::{Surface, SurfacePart};
pub use tissue_kind::TissueKind;

/// Most cells along one axis.
pub const MAX_CELLS_PER_AXIS: usize = 1024;
/// Largest number of elements that a probe is solved for in: a thread takes some hundred megabytes for so many.
const MOST_CELLS: usize = 1_000_000;
/// Most elements in a scene.
pub const MAX_ELEMENTS: usize = 4_000_000;
/// Smallest and largest edge of an element.
pub const SPACING_RANGE_M: [f64; 2] = [1e-4, 1e-2];

/// A label volume of cubic cells, x fastest; any label but zero is tissue, of the structure with that label.
#[derive(Clone, Debug)]
pub struct Labels {
    /// Cells along x, y, z.
    pub dims: [usize; 3],
    /// Edge of a cell, m.
    pub spacing_m: f64,
    /// One label for each cell.
    pub cells: Vec<u8>,
    /// Empty: all tissue is one structure.
    pub structures: Vec<Structure>,
}

/// A body at rest.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name, as the session announces it.
    pub name: String,
    /// Structures, at least one; elements know theirs by its place here (`Lattice::structure`).
    pub structures: Vec<Structure>,
    /// Layers around the body, the innermost first; none: springs, as other programs have them (FEM).
    pub layers: Vec<Layer>,
    /// The labels' cells: what is where in the body at rest. Shared with the tissue model, which would otherwise hold a
    /// copy.
    pub lattice: Arc<Lattice>,
    /// Body that the tissue model moves: `lattice`, or a coarser one where that is too expensive.
    pub body: Arc<Lattice>,
    /// Triangles over the body and its parts.
    pub surface: Surface,
    /// Nodes at which hosts get its displacements.
    pub nodes: NodeGrid,
}

impl Scene {
    /// Returns a scene that needs no file, one of [`stylet_settings::BUILTIN_SCENES`].
    pub fn builtin(name: &str) -> Result<Scene, SceneError> {
        let labels = builtin::labels(name).ok_or_else(|| SceneError::Unknown(name.to_owned()))?;
        labels
            .and_then(|labels| Scene::from_labels(name, &labels))
            .map_err(SceneError::Invalid)
    }

    /// Cuts the lattice from labels, or lists every problem with them. Disconnected parts are allowed.
    pub fn from_labels(name: &str, labels: &Labels) -> Result<Scene, Vec<SceneProblem>> {
        let problems = validate::problems_of(labels);
        if !problems.is_empty() {
            return Err(problems);
        }
        let structures = match labels.structures.as_slice() {
            [] => vec![Structure::soft("tissue", 1)],
            several => several.to_vec(),
        };
        let lattice = Arc::new(Lattice::from_checked_labels(labels));
        let surface = Surface::of(&lattice, &structures);
        Ok(Scene {
            name: name.to_owned(),
            structures,
            layers: vec![Layer::FAT],
            nodes: NodeGrid::of(&lattice),
            body: Arc::clone(&lattice),
            lattice,
            surface,
        })
    }

    /// Returns the same scene with the finite elements whose solution for a probe may take minutes: its own cells, or
    /// larger ones where those are too many.
    pub fn in_cells(self) -> Scene {
        self.with_body(MOST_CELLS)
    }

    /// Returns the lattice in at most so many elements.
    pub(crate) fn coarser_body(&self, most_elements: usize) -> Arc<Lattice> {
        let mut body = Arc::clone(&self.lattice);
        while body.element_count() > most_elements {
            body = Arc::new(body.coarser());
        }
        body
    }

    pub(crate) fn with_body(mut self, most_elements: usize) -> Scene {
        self.body = self.coarser_body(most_elements);
        self.nodes = NodeGrid::of(&self.body);
        self.surface.move_with(&self.lattice, &self.body);
        self
    }

    /// Returns how many cells of the lattice lie along the edge of an element of the body.
    pub fn coarseness(&self) -> u32 {
        (self.body.spacing_m / self.lattice.spacing_m).round() as u32
    }

    /// Returns the structure of the material at a place in an element of the body; `local` runs from -0.5 to 0.5 across
    /// it.
    pub fn structure_at(&self, element: u32, local: [f32; 3]) -> u8 {
        if Arc::ptr_eq(&self.body, &self.lattice) {
            return self.lattice.structure(element);
        }
        let (rest_m, edge_m) = (self.body.rest_m(element), self.body.spacing_m);
        let place_m = [0, 1, 2].map(|a| rest_m[a] + f64::from(local[a]).clamp(-0.499, 0.499) * edge_m);
        // A cell of no tissue at the surface counts as most of its element.
        match self.lattice.element_at_rest(place_m) {
            Some(element) => self.lattice.structure(element),
            None => self.body.structure(element),
        }
    }

    /// Returns the box around the targets at rest; around the whole body where there is none.
    pub fn target_bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        let extents = self.lattice.extents(self.structures.len());
        let targets = self
            .structures
            .iter()
            .zip(&extents)
            .filter(|(s, _)| s.role == Role::Target);
        targets
            .map(|(_, extent)| (extent.lower_m, extent.upper_m))
            .reduce(|(low, high), (lower, upper)| {
                let corner = [0, 1, 2];
                (
                    corner.map(|a| low[a].min(lower[a])),
                    corner.map(|a| high[a].max(upper[a])),
                )
            })
            .unwrap_or(self.lattice.bounds_m())
    }
}
