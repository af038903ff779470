//! Tissue models: the place of each element of a scene after each tick.
//!
//! A model takes steps (`TissueModel`); everything else reads the `Deformed` body. A step does not allocate,
//! lock or panic, and its work is bounded by the number of elements times a stated number of passes, never
//! by a clock: the same input gives the same bytes.
//!
//! ```
//! use stylet_sim::limits::TissueParameters;
//! use stylet_sim::scene::Scene;
//! use stylet_sim::tissue::{ChainMailTissue, Held, TissueModel};
//!
//! let scene = Scene::builtin("paper").unwrap();
//! let limits = TissueParameters::default().validate().unwrap();
//! let mut tissue = ChainMailTissue::new(&scene, limits);
//!
//! let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
//! let mut position_m = scene.lattice.rest_m(element);
//! position_m[2] += 2e-3;
//! let report = tissue.step(Some(Held { element, position_m, patch_m: 0.0 }), 1e-3);
//! assert!(report.converged && report.residual <= 1e-3);
//! assert!((tissue.deformed().position_m(element)[2] - position_m[2]).abs() < 1e-8);
//! ```

// What the lists of clippy.toml name has no place in a tick; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

mod ahead;
mod carried;
pub mod chainmail;
mod corners;
mod deformed;
pub mod fem;
mod field;
mod fold;
mod large;
mod model;
mod parts;
mod point;
mod spec;

pub use ahead::element_ahead;
pub use carried::{Carried, CarriedField, Carry, Shift};
pub use chainmail::{ChainMail, ChainMailTissue, TissueState, step};
pub use deformed::Deformed;
pub use fem::FemTissue;
pub use field::{ElementField, PackedField};
pub(crate) use field::{add_fields, add_up};
pub use fold::least_corner;
pub use large::LargeStrain;
pub use model::{Held, HeldOutcome, REACH, Solve, StepReport, TissueModel};
pub use point::MaterialPoint;
pub use spec::{BuildTissue, TissueError, TissueSpec};
