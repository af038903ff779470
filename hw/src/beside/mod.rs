//! What back ends share whose driver is served by a thread beside the force loop.
//!
//! Three threads take part. The *force loop* reads the newest sample and writes a wrench, and never waits ([`ends`]). The
//! *servo thread*, armed, exchanges both with the driver, and turns the force off by itself on a fault or when nobody renews
//! the wrench ([`hold`]). The *keeper*, of normal priority, makes the calls that may block: it connects, watches, releases and
//! connects again ([`keeper`]).

pub mod arm;
pub mod ends;
pub mod errors;
pub mod hold;
pub mod keeper;
pub mod loss;
pub mod open;
pub mod served;
pub mod serving;
pub mod shared;
pub mod stepped;
