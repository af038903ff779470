//! Recordings that this program reads again: its own flight recordings, and motions for the replay device.
//!
//! A flight recording holds a checkpoint and every input after it; both loops are then run again by the same code,
//! and what comes out is compared with what was recorded, bit by bit.

pub mod file;
pub mod motion;
pub mod repeat;
