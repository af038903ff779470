//! Files and folders of one user: private to that user, and refused if they belong to another.

use super::InstanceError;
use std::fs::{DirBuilder, DirEntry, File, OpenOptions, Permissions, TryLockError};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Shared memory of the kernel: POSIX objects, and files in memory.
const SHARED_MEMORY: &str = "/dev/shm";

/// User of this process.
pub(super) fn user() -> u32 {
    // SAFETY: getuid has no preconditions.
    unsafe { libc::getuid() }
}

/// Returns the folder of all instances: in the user's session if there is one, else in shared memory.
pub(super) fn base() -> PathBuf {
    bases().next().unwrap_or_else(|| PathBuf::from(SHARED_MEMORY))
}

/// Returns both folders: a core may have been started outside the window's session.
pub(super) fn bases() -> impl Iterator<Item = PathBuf> {
    // A service of the user, and a login without a session manager, lack the variable.
    let named = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let session = Some(named.unwrap_or_else(|| PathBuf::from(format!("/run/user/{}", user())))).filter(|folder| {
        let about = std::fs::symlink_metadata(folder);
        folder.is_absolute() && about.is_ok_and(|a| a.is_dir() && a.uid() == user() && a.mode() & 0o077 == 0)
    });
    let shared = Path::new(SHARED_MEMORY).join(format!("stylet_{}", user()));
    session.map(|folder| folder.join("stylet")).into_iter().chain([shared])
}

/// Opens a private file, which must not be a link.
pub(super) fn open(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    options
        .mode(0o600)
        .custom_flags(libc::O_NOFOLLOW | libc::O_CLOEXEC | libc::O_NONBLOCK)
        .open(path)
}

pub(super) fn is_locked(path: &Path) -> bool {
    let lock = open(OpenOptions::new().read(true), path);
    lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

pub(super) fn is_at(file: &File, path: &Path) -> bool {
    let numbers = |about: io::Result<std::fs::Metadata>| about.ok().map(|a| (a.dev(), a.ino()));
    let of_file = numbers(file.metadata());
    of_file.is_some() && of_file == numbers(std::fs::symlink_metadata(path))
}

pub(super) fn foreign(path: &Path, uid: u32) -> InstanceError {
    let users = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let number = uid.to_string();
    let name = users.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1) == Some(&number)).then(|| name.to_owned())
    });
    InstanceError::Foreign {
        path: path.display().to_string(),
        owner: name.map_or_else(|| format!("user {uid}"), |name| format!("user {name} ({uid})")),
    }
}

/// Makes a private folder, or verifies an existing one.
pub(super) fn secure_folder(path: &Path) -> Result<(), InstanceError> {
    match DirBuilder::new().mode(0o700).create(path) {
        Err(why) if why.kind() != io::ErrorKind::AlreadyExists => return Err(failed(path)(why)),
        _ => {}
    }
    let about = std::fs::symlink_metadata(path).map_err(failed(path))?;
    match () {
        () if about.uid() != user() => Err(foreign(path, about.uid())),
        () if !about.is_dir() => Err(InstanceError::NoFolder(path.display().to_string())),
        () if about.mode() & 0o077 != 0 => {
            std::fs::set_permissions(path, Permissions::from_mode(0o700)).map_err(failed(path))
        }
        () => Ok(()),
    }
}

pub(super) fn entries(folder: &Path) -> impl Iterator<Item = DirEntry> {
    std::fs::read_dir(folder).into_iter().flatten().flatten()
}

pub(super) fn objects(prefix: &str) -> impl Iterator<Item = DirEntry> {
    entries(Path::new(SHARED_MEMORY)).filter(move |entry| entry.file_name().to_string_lossy().starts_with(prefix))
}

pub(super) fn remove_objects(prefix: &str) {
    for entry in objects(prefix) {
        // Files of another user stay: nothing opens them.
        let _ = std::fs::remove_file(entry.path());
    }
}

pub(super) fn failed(path: &Path) -> impl FnOnce(io::Error) -> InstanceError {
    let path = path.display().to_string();
    |why| match why.kind() {
        io::ErrorKind::StorageFull => InstanceError::Full(path),
        _ => InstanceError::Io { path, why },
    }
}
