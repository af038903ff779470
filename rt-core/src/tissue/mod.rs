//! Tissue: where each element of a scene is after each tick.
//!
//! One step is `step(&model, &mut state, held, dt_s)`. It does not allocate, lock or panic, and its work is
//! bounded by the number of elements times a stated number of passes, never by a clock: the same input
//! gives the same bytes.
//!
//! ```
//! use rt_core::scene::Scene;
//! use rt_core::tissue::{ChainMail, Held, TissueParameters, TissueState, step};
//!
//! let scene = Scene::builtin("paper").unwrap();
//! let limits = TissueParameters::default().validate().unwrap();
//! let model = ChainMail::new(&scene, limits);
//! let mut state = TissueState::at_rest(&model);
//!
//! let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
//! let mut position_m = scene.lattice.rest_m(element);
//! position_m[2] += 2e-3;
//! let report = step(&model, &mut state, Some(Held { element, position_m }), 1e-3);
//! assert!(report.converged && report.residual <= 1e-3);
//! ```

pub mod chainmail;
mod check;
mod limits;
mod point;

pub use chainmail::{ChainMail, HeldOutcome, Solve, StepReport, TissueState, step};
pub use check::{largest_violation, write_surface};
pub use limits::{Limits, ParameterProblem, TissueParameters};
pub use point::MaterialPoint;

use serde::{Deserialize, Serialize};

/// An element kept at a position of the scene frame during a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Held {
    pub element: u32,
    pub position_m: [f64; 3],
}
