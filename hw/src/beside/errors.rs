//! An error of a driver: number, name, and what it means for the force.

use crate::device::DeviceFault;

/// How the servo loop responds to an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// Turn the force off until the error has not returned for a while; the connection holds.
    Pause,
    /// The connection is lost: stop, disable, initialise again.
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
    /// How the servo loop responds.
    pub response: Response,
}

/// An error after which the connection holds.
pub const fn pause(code: u32, name: &'static str, fault: DeviceFault) -> KnownError {
    let response = Response::Pause;
    KnownError {
        code,
        name,
        fault,
        response,
    }
}

/// An error after which the connection is lost.
pub const fn reconnect(code: u32, name: &'static str, fault: DeviceFault) -> KnownError {
    let response = Response::Reconnect;
    KnownError {
        code,
        name,
        fault,
        response,
    }
}

/// The entry of `code`; an unknown number pauses the force as a driver's error.
pub fn find(known: &[KnownError], code: u32) -> KnownError {
    let found = known.iter().find(|k| k.code == code);
    found
        .copied()
        .unwrap_or(pause(code, "unknown error", DeviceFault::Driver))
}
