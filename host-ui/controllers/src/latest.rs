//! What the devices are and request, for the window.

use super::kind::{Button, Kind};
use super::wish::{ProbeWish, Wish};

/// Device as the window shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// Display name.
    pub name: String,
    /// Kind of the device.
    pub kind: Kind,
    /// True once the stick or the cap has been at rest; only then does the needle follow it.
    pub was_released: bool,
}

/// State of the last reading, for the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Latest {
    /// Device that controls the needle: the one that was moved last.
    pub holder: Option<Device>,
    /// Speed that this device requests.
    pub wish: Wish,
    /// Device that controls the probe, in a run with two hands.
    pub probe_holder: Option<Device>,
    /// Speed that this device requests.
    pub probe: ProbeWish,
    /// Number of presses of each of [`Button::ALL`] since the start.
    pub presses: [u32; Button::ALL.len()],
    /// Devices that cannot be read, each with the reason and the remedy.
    pub denied: Vec<String>,
    /// Name of the device that was unplugged last.
    pub disconnected: String,
    /// Number of devices that were unplugged since the start.
    pub disconnections: u32,
}
