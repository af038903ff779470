//! Simulation of a needle in soft tissue: a body of labelled cells, its deformation, and the force on the hand.
//!
//! The same input gives the same bytes. The crate has no thread, clock or port: `stylet-runtime` calls it from its
//! loops.
//!
//! ```
//! use stylet_sim::scene::Scene;
//! use stylet_sim::tissue::{FemTissue, Held, TissueModel};
//!
//! // The paper's prostate, held by a needle tip that moves 3 mm along +z.
//! let scene = Scene::builtin("paper").unwrap();
//! let mut tissue = FemTissue::<f32>::new(&scene).unwrap();
//! let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
//! let mut position_m = scene.lattice.rest_m(element);
//! position_m[2] += 3e-3;
//! let report = tissue.step(Some(Held { element, position_m, patch_m: 4e-3 }), 5e-3);
//!
//! // The tip pulls the gland along, and the gland pulls the tip back.
//! assert!((tissue.deformed().position_m(element)[2] - position_m[2]).abs() < 1e-6);
//! assert!(report.tip_force_n.unwrap()[2] < 0.0);
//! ```
//!
//! Two programs show more: `cargo run --release -p stylet-sim --example needle_into_gland` prints depth, force and
//! displacement of an insertion, `--example seed_at_rest` the places where dropped seeds come to rest.
//!
//! | module | holds |
//! |---|---|
//! | [`scene`] | labels and materials, elements, surfaces |
//! | [`tissue`] | models of the body: ChainMail (paper eq. 1 to 5), linear finite elements, large strain near the tip |
//! | [`needle`] | layers, membranes and the tissue that the needle carries along (eq. 6) |
//! | [`line`](mod@line) | compliance of the tissue along a needle, solved before the needle moves |
//! | [`probe`] | ultrasound probe against the wall of the rectum |
//! | [`force`] | force law (eq. 8 to 10), passivity, and the safety gate before the device |
//! | [`active`] | parameters validated for one device |

#![warn(missing_docs)]

pub mod active;
pub mod force;
pub mod limits;
pub mod line;
pub mod migration;
pub mod needle;
pub mod probe;
pub mod scene;
pub mod settings;
mod simd;
pub mod tissue;
