//! The top of every real-time stack.
//!
//! Contract: once a thread holds [`arm::Armed`], until its loop ends, it does not allocate, lock, log, panic or
//! fault a page, and makes no system call but device I/O and the clock sleep. The force goes out before
//! anything else that a tick does. Everything that enters or leaves passes through wait-free rings and triple buffers
//! ([`wiring`]), and through the one blackboard entry that each thread with a device owns.
//! `tests/tests/system/rt_contract.rs` holds this over 10,000 ticks.

// What the lists of clippy.toml name has no place in a tick; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

pub mod arm;
#[cfg(test)]
pub(crate) mod breaking;
pub mod capacities;
pub mod clock;
pub mod contact;
pub mod device_loop;
pub mod exchange;
pub mod haptic;
pub mod haptic_tape;
pub mod layers_met;
pub mod left_loads;
pub mod line_loads;
pub mod motion_lease;
pub mod outside;
pub mod pin;
pub mod pose;
pub mod probe_tape;
pub mod put_in;
pub mod recorder;
pub mod response;
pub mod second;
pub mod seed;
pub mod taped;
pub mod timing;
pub mod tissue;
pub mod tissue_tape;
pub mod watchdog;
pub mod wiring;
pub mod world;
