//! Opening a device whose driver is loaded at run time and kept by a thread.

use core::time::Duration;
use std::sync::mpsc::Receiver;

use crate::library::LoadError;

/// Time limit for a driver to find its device.
const OPEN_LIMIT: Duration = Duration::from_secs(15);

/// Reason why a device could not be opened; the text says what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenError<E: core::error::Error + 'static> {
    /// The driver's library cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// There is no connection to a device.
    #[error(transparent)]
    Connection(E),
    /// The driver does not return from initialisation.
    #[error("the driver does not answer: check the device's power and cable, then try again")]
    NoAnswer,
}

/// Waits for the result of the first attempt.
pub fn first<D, E: core::error::Error + 'static>(opened: &Receiver<Result<D, E>>) -> Result<D, OpenError<E>> {
    match opened.recv_timeout(OPEN_LIMIT) {
        Ok(description) => description.map_err(OpenError::Connection),
        Err(_) => Err(OpenError::NoAnswer),
    }
}
