//! Carries the services of a core to hosts on other machines and their requests back, over zenoh and QUIC with
//! certificates on both sides.
//!
//! `serve` runs next to the core as one more host; `join` offers the same services on another machine. Data flows *core
//! → `serve` → `net` → `join` → hosts*; requests return through `serve::rights` and `serve::lease`.

#![warn(missing_docs)]

pub mod class;
pub mod control;
mod error;
#[cfg(feature = "net")]
pub mod join;
pub mod keys;
#[cfg(feature = "net")]
pub mod net;
pub mod ports;
pub mod say;
#[cfg(feature = "net")]
pub mod serve;
pub mod slice;
pub mod wire;

pub use error::RelayError;
pub use stylet_shm_schema::affinity::now_ns;
