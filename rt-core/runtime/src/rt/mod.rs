//! The top of every real-time stack.
//!
//! Contract: from the moment a thread holds [`arm::Armed`] until its loop ends, it does not allocate, lock, log, panic
//! or fault a page, and makes no system call but device I/O and the clock sleep. The force goes out before anything
//! else in a tick. All input and output passes through wait-free rings and triple buffers ([`wiring`]), and through the
//! one blackboard entry of each thread with a device. `tests/tests/system/rt_contract.rs` checks this over 10,000
//! ticks.

// Ticks must not use what clippy.toml lists; tests may.
#![cfg_attr(
    not(test),
    deny(clippy::disallowed_macros, clippy::disallowed_methods, clippy::disallowed_types)
)]

#[cfg(not(target_family = "wasm"))]
pub mod arm;
pub mod capacities;
pub mod clock;
pub mod contact;
pub mod device_loop;
pub mod device_tape;
pub mod exchange;
pub mod hand;
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
pub mod shown;
pub mod taped;
pub mod timing;
pub mod tissue;
pub mod tissue_tape;
pub mod watchdog;
pub mod wiring;
pub mod world;

#[cfg(test)]
pub(crate) mod tests;
