//! A Phantom and the hand that holds it, simulated.

pub mod hand;
pub mod link;
pub mod path;
pub mod phantom;
