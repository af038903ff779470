//! Processes and their threads: names, start times, and permitted cores.

use super::{Machine, cores};
use std::collections::BTreeSet;
use std::io;

/// A process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Process {
    pub id: u32,
    /// The first fifteen bytes, as the kernel keeps it.
    pub name: String,
}

/// File with the permitted cores of a thread.
const STATUS: &str = "status";

impl Machine {
    /// Returns all processes that the kernel shows, in the order of their ids.
    pub fn processes(&self) -> Vec<Process> {
        let ids = self.names("proc").into_iter().filter_map(|name| name.parse().ok());
        let mut ids: Vec<u32> = ids.collect();
        ids.sort_unstable();
        let named = |id| {
            let name = self.text(&format!("proc/{id}/comm"))?;
            Some(Process { id, name })
        };
        ids.into_iter().filter_map(named).collect()
    }

    /// True if a program of this name runs.
    pub fn runs(&self, name: &str) -> bool {
        self.processes().iter().any(|process| process.name == name)
    }

    /// Returns the file of each thread with its permitted cores.
    pub fn threads(&self, process: u32) -> Vec<String> {
        let folder = format!("proc/{process}/task");
        let names = self.names(&folder);
        let path = |thread: &String| format!("{folder}/{thread}/{STATUS}");
        names.iter().map(path).collect()
    }

    /// Returns the permitted cores of a thread, as the kernel prints them; `None` if `path` is not a thread's.
    pub fn allowed_cores(&self, path: &str) -> Option<String> {
        thread_of(path)?;
        let status = self.text(path)?;
        let list = status.lines().find_map(|l| l.strip_prefix("Cpus_allowed_list:"))?;
        Some(list.trim().to_owned())
    }

    /// Returns the start time of a thread, in ticks of the kernel's clock since boot: another thread with its number
    /// started later.
    pub fn began(&self, path: &str) -> Option<u64> {
        thread_of(path)?;
        let stat = self.text(&format!("{}stat", path.strip_suffix(STATUS)?))?;
        // The name, in brackets, may contain spaces and brackets.
        let (_, rest) = stat.rsplit_once(')')?;
        rest.split_whitespace().nth(19)?.parse().ok()
    }

    /// Restricts a thread to these cores.
    pub fn allow_cores(&self, path: &str, list: &str) -> io::Result<()> {
        let thread = thread_of(path).ok_or(io::ErrorKind::NotFound)?;
        if !self.is_this() {
            return Err(io::Error::other("the threads of another machine cannot be moved"));
        }
        // SAFETY: all zeros is an empty set of cores.
        let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
        let allowed: BTreeSet<usize> = cores(list);
        for core in allowed.into_iter().filter(|&core| core < libc::CPU_SETSIZE as usize) {
            // SAFETY: the core is inside the set.
            unsafe { libc::CPU_SET(core, &mut set) };
        }
        // SAFETY: `set` is valid for reads of its size.
        match unsafe { libc::sched_setaffinity(thread, size_of::<libc::cpu_set_t>(), &set) } {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    }
}

/// Returns the thread of `proc/PROCESS/task/THREAD/status`.
fn thread_of(path: &str) -> Option<libc::pid_t> {
    let (process, thread) = path.strip_prefix("proc/")?.split_once("/task/")?;
    process.parse::<u32>().ok()?;
    let thread = thread.strip_suffix(STATUS)?.strip_suffix('/')?;
    thread.parse().ok().filter(|&id| id > 0)
}
