//! Arming of a servo thread.

use core::fmt;

/// Arms the calling thread; returns a description of what the kernel granted.
pub type Arm = Box<dyn Fn() -> Result<String, ArmError> + Send + Sync>;

/// Reason why a thread could not be armed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ArmError(String);

impl ArmError {
    /// Creates an error with the reason, in words for the operator.
    pub fn new(reason: impl fmt::Display) -> Self {
        Self(reason.to_string())
    }
}
