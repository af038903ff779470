//! Dose of permanent seeds by TG-43U1, dose-volume histograms, and the metrics that score an operator.
//!
//! ```
//! use stylet_dose::decay::Interval;
//! use stylet_dose::{DoseKernel, DosePoints, Dvh, Metric, Seed, Source, Structure};
//!
//! let source = Source::known("6711").unwrap();
//! let kernel = DoseKernel::new(&source, Interval::ALL);
//! let seed = Seed {
//!     position_m: [0.0; 3],
//!     axis: Some([0.0, 0.0, 1.0]),
//!     strength_u: 0.5,
//! };
//!
//! // At 1 cm across, dose is strength times dose rate constant (0.965 cGy/h/U) times mean life (59.4 days / ln 2).
//! let at_1_cm_gy = DosePoints::new(&[[10e-3, 0.0, 0.0]]).of_seeds_gy(&kernel, &[seed])[0];
//! let expected_gy = 0.5 * 0.965e-2 * 59.4 * 24.0 / std::f64::consts::LN_2;
//! assert!((at_1_cm_gy / expected_gy - 1.0).abs() < 2e-3, "{at_1_cm_gy} Gy");
//!
//! // A cube of 1 cc around it.
//! let cube = Structure::of_box("cube", [-5e-3; 3], [5e-3; 3], 0.5e-3);
//! let dose_gy = DosePoints::new(&cube.points_m).of_seeds_gy(&kernel, &[seed]);
//! let dvh = Dvh::new(&dose_gy, &cube.volumes_m3).unwrap();
//! let d90_gy = Metric::parse("D90").unwrap().of(&dvh, 145.0).main().unwrap();
//! assert!(d90_gy > at_1_cm_gy);
//! ```
//!
//! `cargo run --release -p stylet-dose --example dose_of_an_implant` prints the figures of a whole implant.
//!
//! Lengths in m, time in s, dose in Gy, air kerma strength in U (1 U = 1 µGy m² h⁻¹); one frame for
//! seeds, structures and grids, chosen by the caller. Water everywhere and no shielding of one seed
//! by another, as in TG-43. No file is read and no signal caught here, so the crate builds for
//! `wasm32-unknown-unknown`, too.
#![warn(missing_docs)]

pub mod along_away;
pub mod criteria;
pub mod criterion;
pub mod curve;
pub mod decay;
pub mod dvh;
pub mod edema;
pub mod effect;
pub mod error;
pub mod gamma;
pub mod grid;
pub mod isodose;
pub mod kernel;
pub mod mesh;
pub mod metric;
pub mod perturb;
pub mod picture;
pub mod points;
pub mod report;
pub mod seed;
pub mod source;
pub mod structure;
pub mod tg43;

pub use dvh::Dvh;
pub use error::DoseError;
pub use grid::DoseGrid;
pub use kernel::DoseKernel;
pub use metric::Metric;
pub use points::DosePoints;
pub use seed::Seed;
pub use source::Source;
pub use structure::{Region, Structure};
