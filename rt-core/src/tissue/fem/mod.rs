//! Linear elasticity on the lattice, quasi-static.

mod cg;
mod coarsest;
mod grid;
mod hexahedron;
mod lanes;
mod level;
mod material;
mod model;
mod multigrid;
mod output;
mod real;
mod simd;
mod smooth;
mod solve;
mod state;
mod sweep;
mod transfer;

pub use material::{FemProblem, FemSettings, Integration, MAX_POISSON_RATIO, Material, Structure};
pub use model::FemModel;
pub use real::Real;
pub use solve::{FemReport, REACH, SolveSettings, TipPatch, step};
pub use state::FemState;

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
