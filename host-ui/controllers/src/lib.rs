//! Gamepads and 3D mice that hold the needle: found, read and interpreted on a separate thread.
//!
//! Below `system`, events go one way: `found` (list of devices) → `state` (events to a [`Wish`]) → `hub` (choice of
//! the device that holds the needle) → `reader` (the thread) → the window, which asks the core to
//! move the hand as it does for the mouse.

#![warn(missing_docs)]

#[cfg(target_family = "wasm")]
mod absent;
mod kind;
mod latest;
#[cfg(not(target_family = "wasm"))]
mod system;
mod wish;

#[cfg(target_family = "wasm")]
pub use absent::Controllers;
pub use kind::{Button, Kind};
pub use latest::{Device, Latest};
#[cfg(not(target_family = "wasm"))]
pub use system::{
    Axis, Controllers, DeviceHub, DeviceSource, DeviceState, Found, ListError, OpenDevice, OpenError, Places, System,
    find, list,
};
pub use wish::{ProbeWish, SLOWEST_M_PER_S, Wish};

/// Speed of the tip along the needle at full deflection; equal to that of the keys.
pub const ALONG_M_PER_S: f64 = 0.04;
/// Speed of the tip across the template at full deflection: a hole in half a second.
pub const ACROSS_M_PER_S: f64 = 0.01;
/// Speed of the probe about its axis: 40 degrees in a second.
pub const TURN_RAD_PER_S: f64 = 0.7;
/// Share of the speed that remains with the shoulder buttons or Shift.
pub const SLOW: f64 = 0.25;
