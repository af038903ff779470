//! Reasons why a device cannot be read, each with a remedy.

use super::found::Found;
use std::io::{self, ErrorKind};
use std::path::PathBuf;

/// Error of a device that is plugged in and cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// This user has no right to read it.
    #[error(
        "{name} ({}) cannot be read. Run: sudo usermod -aG input $USER and log in again, or add a udev rule (docs/controllers.md).",
        .path.display()
    )]
    NoPermission {
        /// Name of the device.
        name: String,
        /// Its device node.
        path: PathBuf,
    },
    /// It is not an event device, or it failed.
    #[error("{name} ({}) cannot be read: {source}. Unplug it and plug it in again.", .path.display())]
    Unreadable {
        /// Name of the device.
        name: String,
        /// Its device node.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl OpenError {
    pub(super) fn of(found: &Found, source: io::Error) -> Self {
        let (name, path) = (found.name.clone(), found.path.clone());
        match source.kind() {
            ErrorKind::PermissionDenied => Self::NoPermission { name, path },
            _ => Self::Unreadable { name, path, source },
        }
    }
}

/// Error of all devices that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.iter().map(OpenError::to_string).collect::<Vec<_>>().join("\n"))]
pub struct ListError(pub Vec<OpenError>);
