//! Resource limits: raised as far as this process may, reported if too low for a run.

use std::ffi::CStr;

/// Open files of a run: 70 with a second device, 11 more for each host.
const FILES: libc::rlim_t = 192;
/// Largest object in shared memory: a large scene needs up to this.
const LARGEST_FILE: libc::rlim_t = 256 << 20;
const SHARED_MEMORY: &CStr = c"/dev/shm";

/// A limit that prevents the run; the text says what to change.
#[derive(Debug, thiserror::Error)]
pub enum LimitError {
    /// Too few open files.
    #[error(
        "this process may open {0} files and needs {FILES}: raise the hard limit, ulimit -Hn {FILES} or more (nofile in \
         /etc/security/limits.d), and start again"
    )]
    Files(u64),
    /// Too short files.
    #[error(
        "files of this process may be {} KiB long, and shared memory needs up to {} KiB: raise the hard limit, ulimit -Hf unlimited \
         (fsize in /etc/security/limits.d), and start again",
        .bytes >> 10, LARGEST_FILE >> 10
    )]
    FileSize {
        /// Longest file.
        bytes: u64,
    },
    /// No shared memory.
    #[error("there is no shared memory at {folder} ({why}): sudo mount -t tmpfs tmpfs {folder}")]
    NoSharedMemory {
        /// Its folder.
        folder: String,
        /// Error of the system.
        why: std::io::Error,
    },
    /// Shared memory that cannot be written.
    #[error("shared memory at {0} is read-only: sudo mount -o remount,rw {0}")]
    ReadOnly(String),
    /// Shared memory that this user may not write.
    #[error("this user may not write to shared memory at {0}: sudo chmod 1777 {0}")]
    NotWritable(String),
}

/// Raises the soft limits of this process to the hard ones, and ignores SIGXFSZ: a write beyond the file-size limit
/// then fails, and its writer reports the file.
pub fn raise() {
    // SAFETY: SIG_IGN needs no handler.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    for resource in [libc::RLIMIT_NOFILE, libc::RLIMIT_FSIZE] {
        let mut limit = of(resource);
        limit.rlim_cur = limit.rlim_max;
        // SAFETY: `limit` is valid for reads. A refusal changes nothing and is reported by `check`.
        unsafe { libc::setrlimit(resource, &limit) };
    }
}

/// Reports the first limit that is too low for a run.
pub fn check() -> Result<(), LimitError> {
    enough(of(libc::RLIMIT_NOFILE).rlim_cur, of(libc::RLIMIT_FSIZE).rlim_cur)?;
    shared_memory(SHARED_MEMORY)
}

fn of(resource: libc::__rlimit_resource_t) -> libc::rlimit {
    let mut limit = libc::rlimit {
        rlim_cur: libc::RLIM_INFINITY,
        rlim_max: libc::RLIM_INFINITY,
    };
    // SAFETY: `limit` is valid for writes.
    unsafe { libc::getrlimit(resource, &mut limit) };
    limit
}

fn enough(files: libc::rlim_t, file_bytes: libc::rlim_t) -> Result<(), LimitError> {
    if files < FILES {
        return Err(LimitError::Files(files));
    }
    if file_bytes < LARGEST_FILE {
        return Err(LimitError::FileSize { bytes: file_bytes });
    }
    Ok(())
}

fn shared_memory(folder: &CStr) -> Result<(), LimitError> {
    let name = || folder.to_string_lossy().into_owned();
    // SAFETY: an all-zero statvfs is valid.
    let mut stat: libc::statvfs = unsafe { std::mem::zeroed() };
    // SAFETY: the path ends in a zero byte and `stat` is valid for writes.
    if unsafe { libc::statvfs(folder.as_ptr(), &mut stat) } != 0 {
        let why = std::io::Error::last_os_error();
        return Err(LimitError::NoSharedMemory { folder: name(), why });
    }
    if stat.f_flag & libc::ST_RDONLY != 0 {
        return Err(LimitError::ReadOnly(name()));
    }
    // SAFETY: the path ends in a zero byte.
    if unsafe { libc::access(folder.as_ptr(), libc::W_OK | libc::X_OK) } != 0 {
        return Err(LimitError::NotWritable(name()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_is_named_with_what_is_needed() {
        let said = |files, bytes| enough(files, bytes).expect_err("too low").to_string();
        assert!(said(56, libc::RLIM_INFINITY).starts_with("this process may open 56 files and needs 192"));
        assert!(said(1024, 100 << 10).starts_with("files of this process may be 100 KiB long"));
        assert!(enough(FILES, LARGEST_FILE).is_ok());
    }

    #[test]
    fn shared_memory_that_is_missing_or_read_only_is_named() {
        let said = |folder| shared_memory(folder).expect_err("of no use").to_string();
        assert!(said(c"/nowhere/shm").starts_with("there is no shared memory at /nowhere/shm"));
        // Read-only in every container and for everyone but root; elsewhere this test sees nothing.
        if let Err(why) = shared_memory(c"/sys") {
            assert!(why.to_string().contains("/sys"), "{why}");
        }
        assert!(shared_memory(SHARED_MEMORY).is_ok());
    }
}
