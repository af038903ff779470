//! Common parts of back ends whose driver runs on a separate thread, outside the force loop.
//!
//! Three threads take part. The *force loop* reads the newest sample and writes a wrench, and never waits ([`ends`]).
//! The *servo thread*, armed, exchanges both with the driver. It turns the force off by itself on a fault or on a stale
//! wrench ([`hold`]). The *keeper*, of normal priority, makes the calls that may block: it connects, watches, releases
//! and reconnects ([`keeper`]).

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
