//! Common parts of the host program: display units, long work that can be interrupted, whole-file
//! writes, curves in time slots, counts of seen ticks, spellings of nuclides.

#![warn(missing_docs)]

pub mod envelope;
pub mod format;
pub mod input;
pub mod interrupt;
pub mod job;
pub mod lines;
pub mod nuclide;
pub mod output;
pub mod progress_bar;
pub mod seen;

pub use stylet_write::{WriteError, write_streamed, write_whole};
