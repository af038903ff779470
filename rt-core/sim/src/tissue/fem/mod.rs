//! Linear elasticity on the lattice, quasi-static: the reference for ChainMail, and a tissue model itself.
//!
//! Each element is a trilinear hexahedron; unknowns are the displacements of its corners. Nothing is assembled
//! (`hexahedron`, `sweep`). The equations are solved by conjugate gradients, preconditioned with one V-cycle of
//! geometric multigrid: coarse elements have the mean stiffness of their eight children, Chebyshev polynomials smooth,
//! the coarsest level is factored.
//!
//! *Locking.* With `Integration::MeanDilatation` the element's mean dilatation carries all volumetric energy (B-bar),
//! the deviatoric part is integrated fully. `Integration::Full` is the textbook's element, for comparison. Pointwise
//! smoothing loses to the volumetric part as nu comes near 0.5: to 1e-4 the gland needs 10 cycles at nu 0.45, 18 at
//! 0.49, 50 at 0.499.
//!
//! *From tick to tick.* The problem is linear in the displacement of the held patch. While the patch stays, the
//! response to each direction it has moved in is kept, so that a displacement in known directions costs no cycle at
//! all. When the patch changes, the present displacement is the first guess of the new response: that tick is the
//! costly one, unless idle ticks before have prepared the patch (`prepare`).
//!
//! *Foundation.* The surroundings are springs to rest on all free faces (`foundation_pa_per_m`) and fixed structures. A
//! part of the body that has neither stays at rest unless it is held. Around a scene lie layers (`shell`): their springs
//! have the layers' mean stiffness against translation, and the columns of `batch` meet their own stiffness against each
//! displacement of the surface that is a polynomial of second degree.
//!
//! ```
//! use stylet_sim::scene::Scene;
//! use stylet_sim::tissue::Held;
//! use stylet_sim::tissue::fem::{FemModel, FemSettings, FemState, Material, SolveSettings, step};
//!
//! let lattice = Scene::builtin("paper").unwrap().lattice;
//! let model = FemModel::<f32>::new(&lattice, &FemSettings::homogeneous(Material::PROSTATE, 3e5)).unwrap();
//! let mut state = FemState::at_rest(&model);
//!
//! let element = lattice.element_of_cell(53, 31, 80).unwrap();
//! let mut position_m = lattice.rest_m(element);
//! position_m[2] += 2e-3;
//! let held = Held { element, position_m, patch_m: 4e-3 };
//! let settings = SolveSettings { relative_tolerance: 1e-3, max_cycles: 50 };
//! let report = step(&model, &mut state, Some(held), &settings);
//! assert!(report.converged && report.tip_force_n[2] > 0.0);
//! ```

pub mod batch;
mod cg;
mod chebyshev;
mod coarsest;
mod compiled;
mod grid;
mod grip;
mod guess;
mod hexahedron;
mod lanes;
mod level;
mod levels;
mod material;
mod memory;
mod model;
mod multigrid;
mod output;
mod reaction;
mod real;
mod shell;
mod smooth;
mod solve;
mod state;
mod sweep;
mod take_up;
mod tissue;
mod transfer;

pub use compiled::{Compiled, prepare, step};
pub use material::{FemProblem, FemSettings, Integration, MAX_POISSON_RATIO, Material, Structure};
pub use model::FemModel;
pub use real::Real;
#[cfg(test)]
pub(in crate::tissue) use solve::hold_cells;
pub use solve::{FemReport, SolveSettings};
pub use state::FemState;
pub use tissue::FemTissue;

#[cfg(test)]
mod tests;
