//! The end of a window in a web page, which reads no devices of the system.

use super::kind::Button;
use super::latest::Latest;

/// Window's end without devices.
pub struct Controllers;

impl Controllers {
    /// Creates an end without a thread: no device ever holds the needle.
    pub fn none() -> Self {
        Self
    }

    /// Nothing follows: there are no devices.
    pub fn use_two_hands(&self, _two_hands: bool) {}

    /// Returns no device and no button.
    pub fn take(&mut self) -> (Latest, Vec<Button>) {
        (Latest::default(), Vec::new())
    }
}
