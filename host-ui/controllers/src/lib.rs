//! Gamepads and 3D mice that hold the needle: found, read and interpreted on a separate thread.
//!
//! Events go one way: `found` (list of devices) → `state` (events to a [`Wish`]) → `hub` (choice of
//! the device that holds the needle) → `reader` (the thread) → the window, which asks the core to
//! move the hand as it does for the mouse.

#![warn(missing_docs)]

mod axis;
mod error;
mod found;
mod hub;
mod kind;
mod list;
mod reader;
mod state;

pub use axis::{Axis, SLOWEST_M_PER_S};
pub use error::{ListError, OpenError};
pub use found::{Found, Places, find};
pub use hub::{Device, DeviceHub, DeviceSource, Latest, OpenDevice};
pub use kind::{Button, Kind};
pub use list::list;
pub use reader::{Controllers, System};
pub use state::{DeviceState, ProbeWish, Wish};

/// Speed of the tip along the needle at full deflection; equal to that of the keys.
pub const ALONG_M_PER_S: f64 = 0.04;
/// Speed of the tip across the template at full deflection: a hole in half a second.
pub const ACROSS_M_PER_S: f64 = 0.01;
/// Speed of the probe about its axis: 40 degrees in a second.
pub const TURN_RAD_PER_S: f64 = 0.7;
/// Share of the speed that remains with the shoulder buttons or Shift.
pub const SLOW: f64 = 0.25;
