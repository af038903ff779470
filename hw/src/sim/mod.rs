//! A simulated Phantom and the simulated hand that holds it.

pub mod hand;
pub mod link;
pub mod path;
pub mod phantom;
