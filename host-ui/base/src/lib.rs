//! What every part of the host program uses: units for people, long work that can be interrupted, curves in slots of time.

pub mod envelope;
pub mod format;
pub mod interrupt;
pub mod job;
pub mod progress_bar;
