//! An Inverse service for tests: one Inverse3, moved by the test, with errors on command.
//!
//! Names and types of the messages are typed independently here, which reveals a wrong one in the code under test. The
//! test and the fake share a [`Service`]; it is reached over a socket ([`Server`]) or without one, in steps
//! ([`Stepped`]).

#![warn(missing_docs)]

mod server;
mod service;
mod stepped;

pub use server::Server;
pub use service::{IDLE_AFTER_MS, Service, State, Wrong};
pub use stepped::Stepped;
