//! Update of the plan while needles go in: the gland and the seeds as seen now, the dose of the
//! placed seeds, and a new plan for the remaining needles.
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
pub use update::{Doses, Reviewed, SeedsFrom, Situation, Update};
