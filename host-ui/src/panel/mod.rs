//! Panels: each a pure function of prepared data that draws and returns the operator's requests.

mod axis;
pub mod banners;
pub mod class;
pub mod field;
pub mod help;
mod histogram;
pub mod history;
pub mod instructor;
pub mod parameters;
pub mod plots;
pub mod question;
pub mod review;
pub mod setup;
pub mod status;
mod strip;
pub mod structures;
pub mod trainees;
pub mod workflow;
