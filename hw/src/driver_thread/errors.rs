//! A driver's error: number, name, and consequence for the force.

use crate::device::DeviceFault;

/// Response of the servo loop to an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// Turns the force off until the error has been absent for a while; keeps the connection.
    Pause,
    /// Stops, disables and initialises again: the connection is lost.
    Reconnect,
}

/// An error of an interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KnownError {
    /// Its number.
    pub code: u32,
    /// Its name in the vendor's documentation.
    pub name: &'static str,
    /// The fault that the force loop sees.
    pub fault: DeviceFault,
    /// Response of the servo loop.
    pub response: Response,
}

/// Creates an error that keeps the connection.
pub const fn pause(code: u32, name: &'static str, fault: DeviceFault) -> KnownError {
    let response = Response::Pause;
    KnownError {
        code,
        name,
        fault,
        response,
    }
}

/// Creates an error that ends the connection.
pub const fn reconnect(code: u32, name: &'static str, fault: DeviceFault) -> KnownError {
    let response = Response::Reconnect;
    KnownError {
        code,
        name,
        fault,
        response,
    }
}

/// Returns the entry of `code`; an unknown number pauses the force as a driver's error.
pub fn find(known: &[KnownError], code: u32) -> KnownError {
    let found = known.iter().find(|k| k.code == code);
    found
        .copied()
        .unwrap_or(pause(code, "unknown error", DeviceFault::Driver))
}
