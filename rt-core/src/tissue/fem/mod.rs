//! Linear elasticity on the lattice, quasi-static.

mod cg;
mod coarsest;
mod grid;
mod hexahedron;
mod level;
mod material;
mod model;
mod multigrid;
mod output;
mod real;
mod smooth;
mod solve;
mod state;
mod sweep;
mod tissue;
mod transfer;

pub use material::{FemProblem, FemSettings, Integration, MAX_POISSON_RATIO, Material, Structure};
pub use model::FemModel;
pub use real::Real;
pub use solve::{FemReport, REACH, SolveSettings, TipPatch, step};
pub use state::FemState;
pub use tissue::FemTissue;

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
