//! Reasons why a device cannot be read, each with a remedy.

use super::found::Found;
use std::io::{self, ErrorKind};
use std::path::PathBuf;

/// Error of a device that is plugged in and cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{name} ({}) cannot be read{}", path.display(), remedy(.source))]
pub struct OpenError {
    /// Name of the device.
    name: String,
    /// Its device node.
    path: PathBuf,
    /// Error of the operating system.
    source: io::Error,
}

fn remedy(why: &io::Error) -> String {
    match why.kind() {
        ErrorKind::PermissionDenied => {
            ". Run: sudo usermod -aG input $USER and log in again, or add a udev rule (docs/controllers.md).".to_owned()
        }
        _ => format!(": {why}. Unplug it and plug it in again."),
    }
}

impl OpenError {
    pub(super) fn of(found: &Found, source: io::Error) -> Self {
        let (name, path) = (found.name.clone(), found.path.clone());
        Self { name, path, source }
    }
}

/// Error of all devices that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.iter().map(OpenError::to_string).collect::<Vec<_>>().join("\n"))]
pub struct ListError(pub Vec<OpenError>);
