//! Messages to and from the service, independent of the transport.

use std::time::Instant;

/// Reason why a message could not be sent or received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The connection has ended.
    #[error("the service has closed the connection")]
    Closed,
    /// A message arrived that is not text.
    #[error("the service sent a message that is not text")]
    NoText,
}

/// A connection to the service.
pub trait Wire: Send {
    /// Sends a message, without waiting for its answer.
    fn send(&mut self, text: &str) -> Result<(), WireError>;
    /// Puts the next message into `text`; returns false if none arrives before `until`.
    fn receive(&mut self, until: Instant, text: &mut String) -> Result<bool, WireError>;
    /// Closes the connection; nothing is sent or received after it.
    fn close(&mut self);
}
