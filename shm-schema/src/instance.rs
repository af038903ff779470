//! Where programs meet: the folder of an instance, the one program that owns it, and the epoch that hosts join.
//!
//! | in the folder of an instance, mode 0700 | holds |
//! |---|---|
//! | `lock` | locked by the owner, a core or a relay in its place, for as long as it lives; its process number |
//! | `hosts` | locked by each host, shared, while it is connected |
//! | `current` | token of the epoch that hosts join |
//! | `deaf` | token of an epoch whose shared memory a host cannot use: the owner begins another |
//! | `<token>/` | management files of iceoryx2 for that epoch |
//!
//! An epoch is one life of the process that holds the ports. Its token is random and is part of every name in `/dev/shm`, so nobody
//! can leave a file in its way beforehand, and files that were damaged are never opened again.

use std::fs::{DirBuilder, DirEntry, File, OpenOptions, Permissions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Shared memory of the kernel: objects of POSIX, and files in memory.
const SHARED_MEMORY: &str = "/dev/shm";

/// Why an instance cannot be used; the text names the file and says what to do.
#[derive(Debug, thiserror::Error)]
pub enum InstanceError {
    /// Not a name.
    #[error("instance name {0:?}: use 1 to 24 letters, digits or '-'")]
    Name(String),
    /// Another program owns the instance.
    #[error(
        "rt-core or a relay already runs as instance \"{instance}\" (process {process}). End it, or choose another name with --instance"
    )]
    Owned {
        /// Name of the instance.
        instance: String,
        /// What the owner wrote into its lock.
        process: String,
    },
    /// Something of another user is in the way.
    #[error("{path} belongs to {owner}, not to you. Have its owner or an administrator remove it")]
    Foreign {
        /// The file or folder.
        path: String,
        /// Name and number of the user.
        owner: String,
    },
    /// Something is in the way that is no folder.
    #[error("{0} is not a folder. Remove it")]
    NoFolder(String),
    /// The system refuses.
    #[error("{path}: {why}")]
    Io {
        /// The file or folder.
        path: String,
        /// What the system reports.
        why: io::Error,
    },
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> InstanceError {
    let path = path.display().to_string();
    |why| InstanceError::Io { path, why }
}

/// Where two programs meet: the same user and the same instance name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance(String);

impl Default for Instance {
    fn default() -> Self {
        Self("main".to_owned())
    }
}

impl Instance {
    /// Letters, digits and `-`, 1 to 24 of them.
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let fits = (1..=24).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
        fits.then(|| Self(name.to_owned()))
            .ok_or_else(|| InstanceError::Name(name.to_owned()))
    }

    /// The name as typed.
    pub fn name(&self) -> &str {
        &self.0
    }

    /// Folder of the instance, which may not exist yet.
    pub fn folder(&self) -> PathBuf {
        let found = bases()
            .map(|base| base.join(&self.0))
            .find(|folder| is_locked(&folder.join("lock")));
        found.unwrap_or_else(|| base().join(&self.0))
    }

    /// The same, made where it does not exist; an error names what is in the way.
    pub fn make_folder(&self) -> Result<PathBuf, InstanceError> {
        let folder = self.folder();
        if let Some(base) = folder.parent() {
            secure_folder(base)?;
        }
        secure_folder(&folder)?;
        Ok(folder)
    }

    /// Begins the name of every shared-memory object of the instance, in any epoch.
    pub fn prefix(&self) -> String {
        format!("stylet_{}_{}_", user(), self.0)
    }

    /// The epoch that hosts join; `None` while no core runs.
    pub fn epoch(&self) -> Option<Epoch> {
        let folder = self.folder();
        // What a killed owner has left is joined by nobody.
        if !is_locked(&folder.join("lock")) {
            return None;
        }
        let mut token = String::new();
        let current = open(OpenOptions::new().read(true), &folder.join("current")).ok()?;
        current.take(64).read_to_string(&mut token).ok()?;
        let is_token = token.len() == TOKEN_DIGITS && token.bytes().all(|b| b.is_ascii_hexdigit());
        is_token.then(|| Epoch {
            instance: self.clone(),
            folder,
            token,
        })
    }

    /// A lock that says that a host uses the instance.
    pub fn attend(&self) -> Result<Attendance, InstanceError> {
        let path = self.make_folder()?.join("hosts");
        let file = open(OpenOptions::new().read(true).write(true).create(true), &path).map_err(failed(&path))?;
        // Where somebody sweeps at this moment, the next try finds the folder made anew.
        let _ = file.try_lock_shared();
        Ok(Attendance { _lock: file })
    }

    /// Makes this program the owner, and removes what a killed one left.
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

    /// Removes every file of this instance, unless a program owns or uses it. For the program that ends last.
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

/// A host's word that it uses an instance, for as long as it is kept.
pub struct Attendance {
    _lock: File,
}

/// The right to be the core of an instance, for as long as it is kept. What the instance has in shared memory goes with it.
pub struct Owned {
    instance: Instance,
    folder: PathBuf,
    lock: File,
}

impl Owned {
    /// The instance that is owned.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// A new epoch, which hosts do not know yet.
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

    /// A host has said that it cannot use the shared memory of `epoch`.
    pub fn hears_complaint(&self, epoch: &Epoch) -> bool {
        let mut token = String::new();
        let deaf = open(OpenOptions::new().read(true), &self.folder.join("deaf"));
        deaf.and_then(|file| file.take(64).read_to_string(&mut token)).is_ok() && token == epoch.token
    }

    /// Removes the files of every epoch. Hosts keep what they have mapped until they see that the epoch is over.
    pub fn clear(&self) {
        for name in ["current", "deaf"] {
            let _ = std::fs::remove_file(self.folder.join(name));
        }
        for entry in entries(&self.folder) {
            let name = entry.file_name();
            let is_token = name.len() == TOKEN_DIGITS && name.to_string_lossy().bytes().all(|b| b.is_ascii_hexdigit());
            if is_token {
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

const TOKEN_DIGITS: usize = 16;
const TRIES: u32 = 40;

/// One life of the process that holds the ports of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Epoch {
    instance: Instance,
    folder: PathBuf,
    token: String,
}

impl Epoch {
    /// The epoch of that token in the folder of `instance`; for the process that its owner starts.
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

    /// Begins the name of every shared-memory object of this epoch.
    pub fn prefix(&self) -> String {
        format!("{}{}_", self.instance.prefix(), self.token)
    }

    /// Says to the owner that this host cannot use the shared memory of this epoch, which some host has damaged.
    pub fn complain(&self) {
        let deaf = open(
            OpenOptions::new().write(true).create(true).truncate(true),
            &self.folder.join("deaf"),
        );
        // One that cannot be written is tried again.
        let _ = deaf.and_then(|mut file| file.write_all(self.token.as_bytes()));
    }

    /// Takes every right to the objects of this epoch from other users, and has the kernel give all memory that they may use:
    /// writing to an object that finds none left would end the program by a signal.
    pub fn secure(&self) -> Result<(), InstanceError> {
        for entry in objects(&self.prefix()) {
            let path = entry.path();
            // One that was removed meanwhile needs nothing.
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

/// The user of this process.
fn user() -> u32 {
    // SAFETY: getuid has no preconditions.
    unsafe { libc::getuid() }
}

/// The folder of all instances: that of the user's session where there is one, else one in shared memory.
fn base() -> PathBuf {
    bases().next().unwrap_or_else(|| PathBuf::from(SHARED_MEMORY))
}

/// Both folders: a core may have been started outside of the session that a window is in.
fn bases() -> impl Iterator<Item = PathBuf> {
    let session = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| {
        let about = std::fs::symlink_metadata(folder);
        folder.is_absolute() && about.is_ok_and(|a| a.is_dir() && a.uid() == user() && a.mode() & 0o077 == 0)
    });
    let shared = Path::new(SHARED_MEMORY).join(format!("stylet_{}", user()));
    session.map(|folder| folder.join("stylet")).into_iter().chain([shared])
}

/// Opens a file for this user alone, which must not be a link.
fn open(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    options
        .mode(0o600)
        .custom_flags(libc::O_NOFOLLOW | libc::O_CLOEXEC | libc::O_NONBLOCK)
        .open(path)
}

fn is_locked(path: &Path) -> bool {
    let lock = open(OpenOptions::new().read(true), path);
    lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

fn is_at(file: &File, path: &Path) -> bool {
    let numbers = |about: io::Result<std::fs::Metadata>| about.ok().map(|a| (a.dev(), a.ino()));
    let of_file = numbers(file.metadata());
    of_file.is_some() && of_file == numbers(std::fs::symlink_metadata(path))
}

fn foreign(path: &Path, uid: u32) -> InstanceError {
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

/// Makes a folder for this user alone, or finds it to be one.
fn secure_folder(path: &Path) -> Result<(), InstanceError> {
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

fn entries(folder: &Path) -> impl Iterator<Item = DirEntry> {
    std::fs::read_dir(folder).into_iter().flatten().flatten()
}

fn objects(prefix: &str) -> impl Iterator<Item = DirEntry> {
    entries(Path::new(SHARED_MEMORY)).filter(move |entry| entry.file_name().to_string_lossy().starts_with(prefix))
}

fn remove_objects(prefix: &str) {
    for entry in objects(prefix) {
        // Those of another user stay: nothing opens them.
        let _ = std::fs::remove_file(entry.path());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Swept(Instance);

    impl Drop for Swept {
        fn drop(&mut self) {
            self.0.sweep();
        }
    }

    fn fresh(name: &str) -> Swept {
        Swept(Instance::new(&format!("{name}-{}", std::process::id())).expect("a name"))
    }

    #[test]
    fn instance_names_are_file_names() {
        assert!(Instance::new("lab-2").is_ok());
        for bad in ["", "../x", "a b", "a_b", "0123456789012345678901234"] {
            assert!(Instance::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn an_instance_has_one_owner() {
        let instance = fresh("owned");
        let owned = instance.0.own().expect("free");
        let Err(InstanceError::Owned { process, .. }) = instance.0.own() else {
            panic!("owned twice")
        };
        assert_eq!(process, std::process::id().to_string());
        drop(owned);
        assert!(instance.0.own().is_ok());
    }

    #[test]
    fn hosts_find_the_announced_epoch_alone() {
        let instance = fresh("epoch");
        let owned = instance.0.own().expect("free");
        let (first, second) = (owned.begin().expect("room"), owned.begin().expect("room"));
        assert_ne!(first, second);
        assert_eq!(instance.0.epoch(), None);
        owned.announce(&first).expect("room");
        second.complain();
        assert!(!owned.hears_complaint(&first) && owned.hears_complaint(&second));
        assert_eq!(instance.0.epoch(), Some(first));
        owned.clear();
        assert_eq!(instance.0.epoch(), None);
        assert!(!second.root().exists());
    }

    /// A core that was killed used to leave files that kept the next one from starting.
    #[test]
    fn an_owner_removes_what_a_killed_one_left_and_keeps_other_files() {
        let instance = fresh("killed");
        let folder = instance.0.make_folder().expect("room");
        let token = "0123456789abcdef";
        let object = PathBuf::from(format!("/dev/shm/{}{token}_x", instance.0.prefix()));
        std::fs::create_dir(folder.join(token)).expect("room");
        for file in [&object, &folder.join("current"), &folder.join("plan.toml")] {
            std::fs::write(file, token).expect("room");
        }
        let owned = instance.0.own().expect("free");
        assert!(!object.exists() && !folder.join(token).exists() && instance.0.epoch().is_none());
        assert!(folder.join("plan.toml").exists());
        drop(owned);
        assert!(!folder.exists(), "nobody uses it");
    }

    #[test]
    fn what_a_host_uses_is_not_swept() {
        let instance = fresh("attended");
        let attendance = instance.0.attend().expect("room");
        instance.0.sweep();
        assert!(instance.0.folder().exists());
        drop(attendance);
        Instance::default().sweep_dead();
        assert!(!instance.0.folder().exists());
    }

    #[test]
    fn a_folder_that_others_may_enter_is_closed_and_a_file_in_its_place_is_named() {
        let path = std::env::temp_dir().join(format!("stylet-folder-{}", std::process::id()));
        std::fs::create_dir(&path).expect("room");
        std::fs::set_permissions(&path, Permissions::from_mode(0o755)).expect("ours");
        secure_folder(&path).expect("ours");
        assert_eq!(std::fs::metadata(&path).expect("there").mode() & 0o777, 0o700);
        std::fs::remove_dir(&path).expect("ours");
        std::fs::write(&path, "").expect("room");
        let why = secure_folder(&path).expect_err("a file").to_string();
        std::fs::remove_file(&path).expect("ours");
        assert!(why.starts_with(&path.display().to_string()), "{why}");
    }
}
