//! Processes: names, and permitted cores of their threads.

use super::{Machine, cores};
use std::collections::BTreeSet;

/// A process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Process {
    pub id: u32,
    /// The first fifteen bytes, as the kernel keeps it.
    pub name: String,
}

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

    /// Returns the cores that any thread of a process may run on.
    pub fn allowed_cores(&self, process: u32) -> BTreeSet<usize> {
        let folder = format!("proc/{process}/task");
        let of_thread = |thread: &String| {
            let status = self.text(&format!("{folder}/{thread}/status"))?;
            let list = status.lines().find_map(|l| l.strip_prefix("Cpus_allowed_list:"))?;
            Some(cores(list))
        };
        self.names(&folder).iter().filter_map(of_thread).flatten().collect()
    }
}
