//! What every part of the host program uses: units for people, long work that can be interrupted, files that are written
//! whole, curves in slots of time, ticks that were seen, spellings of nuclides.

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
