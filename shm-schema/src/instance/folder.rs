//! The folder of an instance: who owns it, who uses it, and the removal of its remains.

use super::files::{base, bases, entries, failed, is_at, is_locked, open, remove_objects, secure_folder, user};
use super::owned::is_token;
use super::{Epoch, Instance, InstanceError, Owned};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Attempts to own an instance while another program sweeps it.
const TRIES: u32 = 40;

impl Instance {
    /// Folder of the instance, which may not exist yet.
    pub fn folder(&self) -> PathBuf {
        let found = bases()
            .map(|base| base.join(&self.0))
            .find(|folder| is_locked(&folder.join("lock")));
        found.unwrap_or_else(|| base().join(&self.0))
    }

    /// Returns the folder, which is made if missing; an error names the obstacle.
    pub fn make_folder(&self) -> Result<PathBuf, InstanceError> {
        let folder = self.folder();
        if let Some(base) = folder.parent() {
            secure_folder(base)?;
        }
        secure_folder(&folder)?;
        Ok(folder)
    }

    /// Returns the prefix of every shared-memory object of the instance, in any epoch.
    pub fn prefix(&self) -> String {
        format!("stylet_{}_{}_", user(), self.0)
    }

    /// Returns the epoch that hosts join; `None` while no core runs.
    pub fn epoch(&self) -> Option<Epoch> {
        let folder = self.folder();
        // Hosts must not join the remains of a killed owner.
        if !is_locked(&folder.join("lock")) {
            return None;
        }
        let mut token = String::new();
        let current = open(OpenOptions::new().read(true), &folder.join("current")).ok()?;
        current.take(64).read_to_string(&mut token).ok()?;
        is_token(&token).then(|| Epoch {
            instance: self.clone(),
            folder,
            token,
        })
    }

    /// Takes a lock that marks the instance as used by a host.
    pub fn attend(&self) -> Result<Attendance, InstanceError> {
        let path = self.make_folder()?.join("hosts");
        let file = open(OpenOptions::new().read(true).write(true).create(true), &path).map_err(failed(&path))?;
        // If another program is sweeping, the next attempt finds the folder recreated.
        let _ = file.try_lock_shared();
        Ok(Attendance { _lock: file })
    }

    /// Makes this program the owner, and removes the remains of a killed one.
    pub fn own(&self) -> Result<Owned, InstanceError> {
        for _ in 0..TRIES {
            let folder = self.make_folder()?;
            let path = folder.join("lock");
            let mut lock =
                open(OpenOptions::new().read(true).write(true).create(true), &path).map_err(failed(&path))?;
            match lock.try_lock() {
                Ok(()) if is_at(&lock, &path) => {}
                // Swept between opening and locking.
                Ok(()) => continue,
                Err(TryLockError::WouldBlock) => {
                    let mut process = String::new();
                    let _ = lock.read_to_string(&mut process);
                    if process.is_empty() {
                        // A program that sweeps holds the lock for a moment and writes nothing.
                        std::thread::sleep(std::time::Duration::from_millis(5));
                        continue;
                    }
                    return Err(InstanceError::Owned {
                        instance: self.0.clone(),
                        process,
                    });
                }
                Err(TryLockError::Error(why)) => return Err(failed(&path)(why)),
            }
            let number = std::process::id().to_string();
            let written = lock
                .set_len(0)
                .and_then(|()| lock.rewind())
                .and_then(|()| lock.write_all(number.as_bytes()));
            written.map_err(failed(&path))?;
            let owned = Owned {
                instance: self.clone(),
                folder,
                lock,
            };
            owned.clear();
            return Ok(owned);
        }
        Err(failed(&self.folder())(io::ErrorKind::ResourceBusy.into()))
    }

    /// Removes every file of this instance, unless a program owns or uses it. The last program to end calls it.
    pub fn sweep(&self) {
        for base in bases() {
            self.sweep_in(&base);
        }
    }

    /// Removes the files of every other instance of this user that no living program owns or uses.
    pub fn sweep_dead(&self) {
        for base in bases() {
            for entry in entries(&base) {
                let name = entry.file_name().to_string_lossy().into_owned();
                match Self::new(&name) {
                    Ok(instance) if instance != *self => instance.sweep_in(&base),
                    _ => {}
                }
            }
        }
    }

    fn sweep_in(&self, base: &Path) {
        let folder = base.join(&self.0);
        if !folder.is_dir() {
            return;
        }
        let locks = ["lock", "hosts"].map(|name| {
            let lock = open(
                OpenOptions::new().read(true).write(true).create(true),
                &folder.join(name),
            )
            .ok()?;
            lock.try_lock().ok().map(|()| lock)
        });
        if locks.iter().all(Option::is_some) {
            remove_objects(&self.prefix());
            // Another program may remove the same files at the same time.
            let _ = std::fs::remove_dir_all(&folder);
            let _ = std::fs::remove_dir(base);
        }
    }
}

/// A host's lock on an instance, held until dropped.
pub struct Attendance {
    _lock: File,
}
