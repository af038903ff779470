//! The owner's side of an instance, and the epochs that it begins.

use super::files::{entries, failed, foreign, objects, open, remove_objects, secure_folder, user};
use super::{Instance, InstanceError};
use std::fs::{File, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Sixteen hexadecimal digits, which cannot be guessed.
const TOKEN_DIGITS: usize = 16;

/// True if a text is a token.
pub(super) fn is_token(text: &str) -> bool {
    text.len() == TOKEN_DIGITS && text.bytes().all(|b| b.is_ascii_hexdigit())
}

/// The right to be the core of an instance, held until dropped. Dropping it removes the instance's shared memory.
pub struct Owned {
    pub(super) instance: Instance,
    pub(super) folder: PathBuf,
    pub(super) lock: File,
}

impl Owned {
    /// The owned instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Begins an epoch, which hosts do not know yet.
    pub fn begin(&self) -> Result<Epoch, InstanceError> {
        let mut bytes = [0; TOKEN_DIGITS / 2];
        let random = Path::new("/dev/urandom");
        File::open(random)
            .and_then(|mut f| f.read_exact(&mut bytes))
            .map_err(failed(random))?;
        let epoch = Epoch {
            instance: self.instance.clone(),
            folder: self.folder.clone(),
            token: bytes.map(|b| format!("{b:02x}")).concat(),
        };
        secure_folder(&epoch.root())?;
        Ok(epoch)
    }

    /// Lets hosts join `epoch`, whose ports are ready.
    pub fn announce(&self, epoch: &Epoch) -> Result<(), InstanceError> {
        let (path, part) = (self.folder.join("current"), self.folder.join("current.part"));
        let _ = std::fs::remove_file(&part);
        let file = open(OpenOptions::new().write(true).create_new(true), &part);
        file.and_then(|mut f| f.write_all(epoch.token.as_bytes()))
            .and_then(|()| std::fs::rename(&part, &path))
            .map_err(failed(&path))
    }

    /// True if a host has complained that it cannot use the shared memory of `epoch`.
    pub fn hears_complaint(&self, epoch: &Epoch) -> bool {
        let mut token = String::new();
        let deaf = open(OpenOptions::new().read(true), &self.folder.join("deaf"));
        deaf.and_then(|file| file.take(64).read_to_string(&mut token)).is_ok() && token == epoch.token
    }

    /// Removes the files of every epoch. Hosts keep their mappings until they see that the epoch is over.
    pub fn clear(&self) {
        for name in ["current", "deaf"] {
            let _ = std::fs::remove_file(self.folder.join(name));
        }
        for entry in entries(&self.folder) {
            if is_token(&entry.file_name().to_string_lossy()) {
                let _ = std::fs::remove_dir_all(entry.path());
            }
        }
        remove_objects(&self.instance.prefix());
    }
}

impl Drop for Owned {
    fn drop(&mut self) {
        self.clear();
        let _ = self.lock.set_len(0);
        let _ = self.lock.unlock();
        self.instance.sweep();
    }
}

/// One life of the process that holds the ports of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Epoch {
    pub(super) instance: Instance,
    pub(super) folder: PathBuf,
    pub(super) token: String,
}

impl Epoch {
    /// Returns the epoch of that token in the folder of `instance`; for the process that its owner starts.
    pub fn of(instance: Instance, folder: PathBuf, token: String) -> Self {
        Self {
            instance,
            folder,
            token,
        }
    }

    /// The instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Folder of the instance.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Sixteen random hexadecimal digits.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Folder of the management files.
    pub fn root(&self) -> PathBuf {
        self.folder.join(&self.token)
    }

    /// Returns the prefix of every shared-memory object of this epoch.
    pub fn prefix(&self) -> String {
        format!("{}{}_", self.instance.prefix(), self.token)
    }

    /// Reports to the owner that this host cannot use the shared memory of this epoch, which some host has damaged.
    pub fn complain(&self) {
        let deaf = open(
            OpenOptions::new().write(true).create(true).truncate(true),
            &self.folder.join("deaf"),
        );
        // A complaint that cannot be written is tried again.
        let _ = deaf.and_then(|mut file| file.write_all(self.token.as_bytes()));
    }

    /// Revokes other users' rights to the objects of this epoch, and allocates all memory that they may use: writing to
    /// an object without memory would end the program by a signal.
    pub fn secure(&self) -> Result<(), InstanceError> {
        for entry in objects(&self.prefix()) {
            let path = entry.path();
            // An object removed meanwhile needs nothing.
            let Ok(file) = open(OpenOptions::new().read(true).write(true), &path) else {
                continue;
            };
            let Ok(about) = file.metadata() else { continue };
            if about.uid() != user() {
                return Err(foreign(&path, about.uid()));
            }
            file.set_permissions(Permissions::from_mode(0o600))
                .map_err(failed(&path))?;
            if about.len() > 0 {
                use std::os::fd::AsRawFd;
                // SAFETY: the file is open; allocating within its size changes nothing that it holds.
                let code = unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, about.len() as libc::off_t) };
                if code == libc::ENOSPC {
                    return Err(failed(&path)(io::ErrorKind::StorageFull.into()));
                }
            }
        }
        Ok(())
    }
}
