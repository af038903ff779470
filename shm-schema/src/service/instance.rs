//! Where programs meet: the user's and the instance's part of every name in shared memory.

use super::sweep::Turn;
use super::{Ipc, Node, ServiceError, failed};
use iceoryx2::config::Config;
use iceoryx2::node::NodeBuilder;
use iceoryx2::prelude::{FileName, LogLevel, Path, SemanticString, SignalHandlingMode, set_log_level};
use std::time::Duration;

/// Where two programs meet: the same user and the same instance name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance(String);

impl Instance {
    /// Letters, digits and `-`, 1 to 24 of them.
    pub fn new(name: &str) -> Result<Self, ServiceError> {
        let fits = (1..=24).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
        if fits {
            Ok(Self(name.to_owned()))
        } else {
            Err(ServiceError(format!(
                "instance name {name:?}: use 1 to 24 letters, digits or '-'"
            )))
        }
    }

    /// The name as typed.
    pub fn name(&self) -> &str {
        &self.0
    }

    /// Folder of the management files, on tmpfs because iceoryx2 syncs them.
    pub fn root(&self) -> String {
        format!("/dev/shm/{}", self.prefix().trim_end_matches('_'))
    }

    /// Begins the name of every shared-memory object.
    pub fn prefix(&self) -> String {
        format!("{}{}_", prefix_of_user(), self.0)
    }

    pub(super) fn config(&self) -> Result<Config, ServiceError> {
        let mut config = Config::default();
        config
            .global
            .set_root_path(&Path::new(self.root().as_bytes()).map_err(|e| failed("root path", e))?);
        config.global.prefix = FileName::new(self.prefix().as_bytes()).map_err(|e| failed("prefix", e))?;
        config.global.creation_timeout = Duration::from_millis(20);
        Ok(config)
    }

    /// A node of this instance; removes what dead programs left.
    pub fn node(&self) -> Result<Node, ServiceError> {
        set_log_level(LogLevel::Fatal);
        let free = free_bytes();
        if free < MIN_ROOM_BYTES {
            return Err(failed("shared memory is full", format!("{free} bytes left")));
        }
        let _turn = Turn::start();
        NodeBuilder::new()
            .config(&self.config()?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map(Node::new)
            .map_err(|e| failed("cannot use shared memory", e))
    }

    /// Has the kernel give all memory that this instance's objects may use: writing to an object that finds none left
    /// would end the program by a signal.
    pub fn secure_room(&self) -> Result<(), ServiceError> {
        use std::os::fd::AsRawFd;
        let prefix = self.prefix();
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            let ours = entry.file_name().to_string_lossy().starts_with(&prefix);
            let Some(size) = entry
                .metadata()
                .ok()
                .filter(|m| ours && m.is_file() && m.len() > 0)
                .map(|m| m.len())
            else {
                continue;
            };
            // One that was removed meanwhile needs no memory.
            let Ok(file) = std::fs::File::options().write(true).open(entry.path()) else {
                continue;
            };
            // SAFETY: the file is open; allocating within its size changes nothing that it holds.
            let code = unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, size as libc::off_t) };
            if code == libc::ENOSPC {
                return Err(failed("shared memory is full", format!("no room for {size} bytes")));
            }
        }
        Ok(())
    }
}

/// Begins the names of all instances of this user.
pub(super) fn prefix_of_user() -> String {
    // SAFETY: getuid has no preconditions.
    let user = unsafe { libc::getuid() };
    format!("stylet_{user}_")
}

/// Less than this, and even the first objects of a program might not fit.
const MIN_ROOM_BYTES: u64 = 4 << 20;

/// Free memory in `/dev/shm`; all there could be when the kernel does not say.
fn free_bytes() -> u64 {
    // SAFETY: an all-zero statvfs is valid.
    let mut stat: libc::statvfs = unsafe { std::mem::zeroed() };
    // SAFETY: the path ends in a zero byte and `stat` is valid for writes.
    let failed = unsafe { libc::statvfs(c"/dev/shm".as_ptr(), &mut stat) };
    if failed == 0 {
        stat.f_bavail * stat.f_frsize
    } else {
        u64::MAX
    }
}

impl Default for Instance {
    fn default() -> Self {
        Self("main".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instance_names_are_file_names() {
        assert!(Instance::new("lab-2").is_ok());
        for bad in ["", "../x", "a b", "a_b", "0123456789012345678901234"] {
            assert!(Instance::new(bad).is_err(), "{bad}");
        }
    }
}
