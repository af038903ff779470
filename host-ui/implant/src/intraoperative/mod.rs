//! The plan brought up to date while needles go in: the gland as it is seen now, the seeds where they are seen, the dose of what lies
//! there, and the needles that are left planned anew.
//!
//! Lengths in m, scene frame, as the tissue lies at that moment.

pub mod agreement;
mod contour;
mod marks;
mod outline;
mod solid;
mod spline;
mod update;

pub use agreement::Agreement;
pub use contour::{Clicks, Contour, Transverse};
pub use marks::Marks;
pub use outline::Outline;
pub use solid::{ContourError, PLANES, Solid, proposed_at};
pub use update::{Doses, Proposed, Reviewed, SeedsFrom, Situation, Update};
