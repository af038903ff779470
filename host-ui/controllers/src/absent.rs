//! Controllers in a web page, which reads no devices of the system.

use super::kind::Button;
use super::latest::Latest;

/// No controllers.
pub struct Controllers;

impl Controllers {
    /// Returns controllers of which none ever holds the needle.
    pub fn none() -> Self {
        Self
    }

    /// Has no effect: there are no devices.
    pub fn use_two_hands(&self, _two_hands: bool) {}

    /// Returns no device and no button.
    pub fn take(&mut self) -> (Latest, Vec<Button>) {
        (Latest::default(), Vec::new())
    }
}
