//! A separate trace instance in the kernel's tracefs: created, frozen, read, and always removed, even if this process
//! is killed.

use crate::machine::Machine;
use std::ffi::CString;
use std::fs;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Buffer of each core: a tenth of a second of a busy one. No longer than necessary, since nothing is recorded while it
/// is read.
pub const BUFFER_KIB: u64 = 256;
/// Prefix of our instances' names; the number of the process follows.
const NAME: &str = "stylet-";
/// Events recorded if the kernel has them; `*` stands for all of a group with this suffix.
const EVENTS: &[&str] = &[
    "sched/sched_switch",
    "sched/sched_waking",
    "irq/irq_handler_entry",
    "irq/irq_handler_exit",
    "irq/softirq_entry",
    "irq/softirq_exit",
    "irq_vectors/*_entry",
    "irq_vectors/*_exit",
    "timer/hrtimer_expire_entry",
    "timer/hrtimer_expire_exit",
    "timer/timer_expire_entry",
    "timer/timer_expire_exit",
    "workqueue/workqueue_execute_start",
    "workqueue/workqueue_execute_end",
    "power/cpu_idle",
];
/// System calls with long work in the kernel.
const CALLS: &[&str] = &[
    "fsync",
    "fdatasync",
    "sync",
    "syncfs",
    "msync",
    "munmap",
    "madvise",
    "mremap",
    "ftruncate",
    "unlink",
    "unlinkat",
    "write",
    "pwrite64",
    "fallocate",
    "exit_group",
    "clone",
    "execve",
];

/// Reason why there is no trace. The text is for people.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    #[error("the kernel's trace cannot be used: {0}; it needs root (sudo) and a kernel with CONFIG_TRACING")]
    Tracefs(io::Error),
    #[error("{path} cannot be used: {why}")]
    File { path: PathBuf, why: io::Error },
    #[error("the process that removes the trace instance does not start: {0}")]
    Keeper(io::Error),
}

/// The root of tracefs; our own mount ends with it and disturbs no one.
struct Root {
    path: PathBuf,
    _mount: Option<OwnedFd>,
}

impl Root {
    fn open() -> Result<Self, TraceError> {
        let mounts = fs::read_to_string("/proc/mounts").unwrap_or_default();
        let mounted = mounts.lines().find_map(|l| {
            let mut words = l.split(' ');
            let (_, path, kind) = (words.next()?, words.next()?, words.next()?);
            (kind == "tracefs").then(|| PathBuf::from(path))
        });
        if let Some(path) = mounted {
            return fs::read_dir(path.join("instances"))
                .map(|_| Self { path, _mount: None })
                .map_err(TraceError::Tracefs);
        }
        let mount = mount().map_err(TraceError::Tracefs)?;
        Ok(Self {
            path: PathBuf::from(format!("/proc/self/fd/{}", mount.as_raw_fd())),
            _mount: Some(mount),
        })
    }

    fn instance(&self, name: &str) -> PathBuf {
        self.path.join("instances").join(name)
    }
}

/// Returns a mount of tracefs that is attached to no folder.
fn mount() -> io::Result<OwnedFd> {
    const FSCONFIG_CMD_CREATE: libc::c_ulong = 6;
    let own = |result: libc::c_long| {
        if result < 0 {
            return Err(io::Error::last_os_error());
        }
        // SAFETY: the call returned a descriptor with no other owner.
        Ok(unsafe { OwnedFd::from_raw_fd(result as libc::c_int) })
    };
    let kind = CString::new("tracefs")?;
    let none: *const libc::c_char = std::ptr::null();
    // SAFETY: `kind` ends with a zero; 1 is FSOPEN_CLOEXEC.
    let context = own(unsafe { libc::syscall(libc::SYS_fsopen, kind.as_ptr(), 1) })?;
    // SAFETY: this command takes neither key nor value.
    let made = unsafe {
        libc::syscall(
            libc::SYS_fsconfig,
            context.as_raw_fd(),
            FSCONFIG_CMD_CREATE,
            none,
            none,
            0,
        )
    };
    if made != 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: numbers only; 1 is FSMOUNT_CLOEXEC.
    own(unsafe { libc::syscall(libc::SYS_fsmount, context.as_raw_fd(), 1, 0) })
}

/// A running instance.
pub struct Instance {
    root: Root,
    name: String,
    /// Removes the instance as soon as its input ends, so that not even SIGKILL leaves one behind.
    keeper: Option<Child>,
    /// Events supported by the kernel, as `group/name`.
    pub events: Vec<String>,
}

impl Instance {
    /// Makes an instance, which records from now on.
    pub fn start() -> Result<Self, TraceError> {
        let root = Root::open()?;
        remove_dead(&root);
        let name = format!("{NAME}{}", std::process::id());
        let folder = root.instance(&name);
        fs::create_dir(&folder).map_err(|why| TraceError::File {
            path: folder.clone(),
            why,
        })?;
        let mut instance = Self {
            root,
            name,
            keeper: None,
            events: Vec::new(),
        };
        // From here on dropping it removes it.
        instance.keeper = keeper(&instance.name)?;
        instance.put("tracing_on", "0")?;
        instance.put("trace_clock", "mono")?;
        instance.put("buffer_size_kb", &BUFFER_KIB.to_string())?;
        instance.events = instance.enable();
        instance.put("tracing_on", "1")?;
        Ok(instance)
    }

    fn path(&self, file: &str) -> PathBuf {
        self.root.instance(&self.name).join(file)
    }

    fn put(&self, file: &str, value: &str) -> Result<(), TraceError> {
        let path = self.path(file);
        fs::write(&path, value).map_err(|why| TraceError::File { path, why })
    }

    /// Enables the supported events; returns them.
    fn enable(&self) -> Vec<String> {
        let names_of = |group: &str| Machine::at(self.path("events")).names(group);
        let mut wanted: Vec<String> = Vec::new();
        for event in EVENTS {
            match event.split_once("/*") {
                None => wanted.push((*event).to_owned()),
                Some((group, ending)) => {
                    let all = names_of(group).into_iter().filter(|n| n.ends_with(ending));
                    wanted.extend(all.map(|n| format!("{group}/{n}")));
                }
            }
        }
        for call in CALLS {
            wanted.extend(["enter", "exit"].map(|side| format!("syscalls/sys_{side}_{call}")));
        }
        wanted.retain(|event| self.put(&format!("events/{event}/enable"), "1").is_ok());
        wanted
    }

    /// Stops recording; the buffer is kept.
    pub fn freeze(&self) -> Result<(), TraceError> {
        self.put("tracing_on", "0")
    }

    /// Resumes recording.
    pub fn thaw(&self) -> Result<(), TraceError> {
        self.put("tracing_on", "1")
    }

    /// Returns everything in the buffer of `core`.
    pub fn read(&self, core: usize) -> Result<String, TraceError> {
        let path = self.path(&format!("per_cpu/cpu{core}/trace"));
        let bytes = fs::read(&path).map_err(|why| TraceError::File { path, why })?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Events that were overwritten or dropped in the buffer of `core` because they were not read in time.
    pub fn dropped(&self, core: usize) -> u64 {
        let stats = fs::read_to_string(self.path(&format!("per_cpu/cpu{core}/stats"))).unwrap_or_default();
        let of = |key: &str| {
            stats
                .lines()
                .find_map(|l| l.strip_prefix(key)?.trim().parse::<u64>().ok())
        };
        of("dropped events:").unwrap_or(0)
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        let _ = self.freeze();
        match self.keeper.take() {
            Some(mut child) => {
                drop(child.stdin.take());
                let _ = child.wait();
            }
            None => remove(&self.root, &self.name),
        }
    }
}

fn remove(root: &Root, name: &str) {
    let folder = root.instance(name);
    // It is busy while it is read.
    for _ in 0..50 {
        match fs::remove_dir(&folder) {
            Err(e) if e.kind() == io::ErrorKind::ResourceBusy => {
                std::thread::sleep(std::time::Duration::from_millis(20))
            }
            _ => return,
        }
    }
}

/// Removes instances of dead processes.
fn remove_dead(root: &Root) {
    let names = Machine::at(&root.path).names("instances");
    for name in names {
        let pid = name.strip_prefix(NAME).and_then(|pid| pid.parse::<u32>().ok());
        if pid.is_some_and(|pid| !Path::new(&format!("/proc/{pid}")).exists()) {
            remove(root, &name);
        }
    }
}

/// The keeper is this program; a program without the task (a test of this crate) has none and removes the instance
/// itself.
fn keeper(name: &str) -> Result<Option<Child>, TraceError> {
    let program = std::env::current_exe().map_err(TraceError::Keeper)?;
    if program.file_name().is_none_or(|n| n != "stylet-lab") {
        return Ok(None);
    }
    let child = Command::new(program)
        .args(["trace-keeper", name])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        // Ctrl-C in the terminal is for the measurement alone.
        .process_group(0)
        .spawn()
        .map_err(TraceError::Keeper)?;
    Ok(Some(child))
}

/// The keeper's whole work: waits until the input ends, then removes the instance `name`.
pub fn keep(name: &str) -> Result<(), TraceError> {
    io::copy(&mut io::stdin(), &mut io::sink()).map_err(TraceError::Keeper)?;
    if name.starts_with(NAME) && !name.contains('/') {
        remove(&Root::open()?, name);
    }
    Ok(())
}
