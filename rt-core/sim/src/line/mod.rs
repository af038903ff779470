//! The condensed needle line: forces between needle and tissue along its way, and on the hand.
//!
//! *Before the needle moves*: [`Line`] and [`Stations`] lie along the way; [`ColumnQueue`] solves for the body's answer
//! to a unit force at each of them, in slices that fit into idle ticks; [`Compliance`] is how each station moves with
//! each. *At 1 kHz*: [`step`] finds the forces of shaft and tip from friction, membranes and that compliance, with one
//! slip state. *At the rate of the tissue*: the body is the sum of `loads_n` times columns.
//!
//! Derivations are in `docs/physics.md`, measurements in `docs/adr/0010-condensed-needle-line.md`.
//!
//! ```
//! use stylet_sim::line::{LineInput, LineLayer, LineModel, LineSettings, LineState, step};
//!
//! // Two stations, 1 mm apart, that do not know each other: 1 mm of displacement for each newton.
//! let compliance = stylet_sim::line::Compliance::diagonal(2, 1e-3, 1e-3);
//! let layers = [LineLayer { shaft_friction_n_per_m: 100.0, ..LineLayer::default() }];
//! let model = LineModel::new(compliance, &layers, LineSettings::default()).unwrap();
//! let mut state = LineState::new(&model);
//! // Shaft that has just come in sticks where it is, without a force.
//! assert_eq!(step(&model, &mut state, &LineInput { tip_m: 2e-3, dt_s: 1e-3 }).force_on_hand_n, 0.0);
//! // Half a millimetre on both stations slip: 100 N/m of friction over 2 mm of shaft.
//! let output = step(&model, &mut state, &LineInput { tip_m: 2.5e-3, dt_s: 1e-3 });
//! assert!((output.force_on_hand_n + 0.2).abs() < 1e-9, "{output:?}");
//! ```

mod across;
pub mod beam;
mod column;
mod columns;
mod compliance;
mod contact;
mod cross;
mod left;
mod model;
mod near;
mod outside;
pub mod prony;
mod ready;
mod rows;
mod state;
mod stations;
mod tip;

pub use column::{SeedHold, push};
pub use columns::{Column, ColumnQueue, Load, QueueProgress, TOLERANCE};
pub use compliance::Compliance;
pub use contact::{LineInput, step};
pub use cross::{Cross, LineStations};
pub use left::{LeftNeedle, LeftNeedles, LeftRecord, LeftShare, MAX_LEFT, MAX_LEFT_LOADS};
pub use model::{LineLayer, LineModel, LineProblem, LineSettings, MAX_LAYERS, MAX_STATIONS};
pub use prony::PronyTerm;
pub use ready::{BodyAnswer, BodyLine, HandLine, LayerForces, LineError, LineSource, NeedleBending, ReadyLine, Track};
pub use rows::Rows;
pub use state::{LineOutput, LineState, TipState};
pub use stations::{Line, NEEDLE_RADIUS_M, StationSettings, Stations};
