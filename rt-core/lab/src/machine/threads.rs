//! Processes and threads: names, permitted cores, priorities, processor time.

use super::{Machine, cores};
use std::collections::BTreeSet;

/// A process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Process {
    pub id: u32,
    /// The first fifteen bytes, as the kernel keeps it.
    pub name: String,
}

/// A thread with its processor time so far.
#[derive(Clone, Debug)]
pub struct StatOfThread {
    pub id: u32,
    pub process: u32,
    pub parent: u32,
    pub name: String,
    /// Core on which it ran last.
    pub core: usize,
    /// Real-time priority; `None` for a normal thread.
    pub priority: Option<u32>,
    pub ran_ns: u64,
}

/// Priority of a thread with deadlines, above all others.
const DEADLINE: u32 = 100;

impl Machine {
    /// Returns all threads that the kernel shows.
    pub fn threads(&self) -> Vec<StatOfThread> {
        let processes = self.names("proc").into_iter().filter_map(|name| name.parse().ok());
        let of = |process: u32| {
            let ids = self.names(&format!("proc/{process}/task")).into_iter();
            ids.filter_map(move |id| self.thread(process, id.parse().ok()?))
        };
        processes.flat_map(of).collect()
    }

    fn thread(&self, process: u32, id: u32) -> Option<StatOfThread> {
        let stat = self.text(&format!("proc/{process}/task/{id}/stat"))?;
        // A name may hold spaces and parentheses.
        let (_, name) = stat.split_once('(')?;
        let (name, rest) = name.rsplit_once(')')?;
        let words: Vec<&str> = rest.split_whitespace().collect();
        // Numbered from 3, the state, in proc(5).
        let field = |n: usize| words.get(n - 3)?.parse::<u32>().ok();
        let priority = match field(41)? {
            1 | 2 => field(40),
            6 => Some(DEADLINE),
            _ => None,
        };
        Some(StatOfThread {
            id,
            process,
            parent: field(4)?,
            name: name.to_owned(),
            core: field(39)? as usize,
            priority,
            ran_ns: self.ran_ns(process, id)?,
        })
    }

    /// Returns the processor time of a thread so far.
    pub fn ran_ns(&self, process: u32, id: u32) -> Option<u64> {
        self.schedstat(process, id, 0)
    }

    /// Returns the time so far in which a thread could run and another one had its core.
    pub fn waited_ns(&self, process: u32, id: u32) -> Option<u64> {
        self.schedstat(process, id, 1)
    }

    fn schedstat(&self, process: u32, id: u32, word: usize) -> Option<u64> {
        let text = self.text(&format!("proc/{process}/task/{id}/schedstat"))?;
        text.split(' ').nth(word)?.parse().ok()
    }

    /// Returns the number of this process's thread of this name.
    pub fn own_thread(&self, name: &str) -> Option<u32> {
        let threads = self.names("proc/self/task");
        let of_name = |id: &&String| self.text(&format!("proc/self/task/{id}/comm")).as_deref() == Some(name);
        threads.iter().find(of_name)?.parse().ok()
    }

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
