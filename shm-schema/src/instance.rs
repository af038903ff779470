//! The folder of an instance, the one program that owns it, and the epoch that hosts join.
//!
//! | in the folder of an instance, mode 0700 | holds |
//! |---|---|
//! | `lock` | locked by the owner, a core or a relay in its place, for as long as it lives; its process number |
//! | `hosts` | locked by each host, shared, while it is connected |
//! | `current` | token of the epoch that hosts join |
//! | `deaf` | token of an epoch whose shared memory a host cannot use: the owner begins another |
//! | `<token>/` | management files of iceoryx2 for that epoch |
//!
//! An epoch is one life of the process that holds the ports. Its random token is part of every name in `/dev/shm`:
//! other programs cannot place a file in its way beforehand, and damaged files are never opened again.

#[cfg(not(target_family = "wasm"))]
mod files;
// A browser has no folders: an instance is only a name there.
#[cfg(not(target_family = "wasm"))]
mod folder;
#[cfg(not(target_family = "wasm"))]
mod owned;
#[cfg(test)]
mod tests;

#[cfg(not(target_family = "wasm"))]
pub use folder::Attendance;
#[cfg(not(target_family = "wasm"))]
pub use owned::{Epoch, Owned};
use std::io;

/// Reason why an instance cannot be used; the text names the file and says what to do.
#[derive(Debug, thiserror::Error)]
pub enum InstanceError {
    /// Invalid name.
    #[error("instance name {0:?}: use 1 to 24 letters, digits or '-'")]
    Name(String),
    /// Another program owns the instance.
    #[error(
        "another rt-core or a relay runs as instance \"{instance}\" (process {process}). End it, or choose another name with --instance"
    )]
    Owned {
        /// Name of the instance.
        instance: String,
        /// Contents of the owner's lock.
        process: String,
    },
    /// A file of another user is in the way.
    #[error("{path} belongs to {owner}, not to you. Have its owner or an administrator remove it")]
    Foreign {
        /// The file or folder.
        path: String,
        /// Name and number of the user.
        owner: String,
    },
    /// The path is not a folder.
    #[error("{0} is not a folder. Remove it")]
    NoFolder(String),
    /// No memory is left for the file.
    #[error("{0}: no space left. /dev/shm needs room (df -h /dev/shm)")]
    Full(String),
    /// The system refuses.
    #[error("{path}: {why}")]
    Io {
        /// The file or folder.
        path: String,
        /// Error of the operating system.
        why: io::Error,
    },
}

/// Meeting point of two programs: the same user and the same instance name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance(String);

impl Default for Instance {
    fn default() -> Self {
        Self("main".to_owned())
    }
}

impl Instance {
    /// Checks a name: letters, digits and `-`, 1 to 24 of them.
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let fits = (1..=24).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
        fits.then(|| Self(name.to_owned()))
            .ok_or_else(|| InstanceError::Name(name.to_owned()))
    }

    /// The name as typed.
    pub fn name(&self) -> &str {
        &self.0
    }
}
