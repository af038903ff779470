//! Removes what programs left in shared memory, of one instance or of all whose programs were killed.

use super::instance::prefix_of_user;
use super::{Instance, Ipc};
use iceoryx2::node::{Node, NodeState, NodeView};
use iceoryx2::prelude::CallbackProgression;
use std::collections::BTreeSet;
use std::fs::{DirEntry, File};
use std::os::fd::AsRawFd;
use std::time::Duration;

/// Where all instances have their files.
const FOLDER: &str = "/dev/shm";

impl Instance {
    /// Removes every file of this instance, unless a program still uses it. For the program that ends last.
    pub fn sweep(&self) {
        self.sweep_unless(|_| true);
    }

    /// The same for a program that ends although a thread of its own may keep its node from being dropped.
    pub fn sweep_at_end(&self) {
        let me = std::process::id();
        self.sweep_unless(|pid| pid != Some(me));
    }

    /// Removes the files of every other instance of this user that no living program uses. A program that was killed leaves
    /// them; one whose name holds its process is never started again under that name. For the start of a program.
    pub fn sweep_dead(&self) {
        // While a program makes its node, its files have no owner yet.
        let Some(_turn) = Turn::sweep() else { return };
        for instance in instances().into_iter().filter(|i| i != self) {
            instance.sweep();
        }
    }

    /// `counts` says whether a node of that process is in use.
    fn sweep_unless(&self, counts: impl Fn(Option<u32>) -> bool) {
        let Ok(config) = self.config() else { return };
        let mut used = false;
        let listed = Node::<Ipc>::list(&config, |state| {
            used |= match &state {
                NodeState::Dead(_) => false,
                NodeState::Alive(view) => counts(view.id().pid::<Ipc>().ok().map(|pid| pid.value() as u32)),
                // An unknown state is taken as alive.
                _ => true,
            };
            CallbackProgression::Continue
        });
        if used || listed.is_err() {
            return;
        }
        // Another program may remove the same files at the same time.
        let _ = std::fs::remove_dir_all(self.root());
        let prefix = self.prefix();
        for entry in entries() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

fn entries() -> impl Iterator<Item = DirEntry> {
    std::fs::read_dir(FOLDER).into_iter().flatten().flatten()
}

/// Every instance of this user that has files.
fn instances() -> Vec<Instance> {
    let prefix = prefix_of_user();
    let named = |entry: DirEntry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        let instance = name.strip_prefix(&prefix)?.split('_').next()?.to_owned();
        Some(instance)
    };
    let names: BTreeSet<String> = entries().filter_map(named).collect();
    names.iter().filter_map(|name| Instance::new(name).ok()).collect()
}

/// A lock on the folder: shared by programs that make their node, taken alone by one that sweeps. It leaves no file.
pub(super) struct Turn {
    _folder: File,
}

/// Any user may hold the lock, so nobody waits for it for long.
const TRIES: u32 = 20;
const BETWEEN_TRIES: Duration = Duration::from_millis(10);

impl Turn {
    /// To make a node; `None` where somebody holds the lock for long.
    pub(super) fn start() -> Option<Self> {
        Self::take(libc::LOCK_SH)
    }

    fn sweep() -> Option<Self> {
        Self::take(libc::LOCK_EX)
    }

    fn take(how: libc::c_int) -> Option<Self> {
        let folder = File::open(FOLDER).ok()?;
        for _ in 0..TRIES {
            // SAFETY: the file is open.
            if unsafe { libc::flock(folder.as_raw_fd(), how | libc::LOCK_NB) } == 0 {
                return Some(Self { _folder: folder });
            }
            std::thread::sleep(BETWEEN_TRIES);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_sweeps_while_a_program_makes_its_node() {
        let starting = Turn::start().expect("nobody sweeps for long");
        assert!(Turn::sweep().is_none());
        drop(starting);
    }

    #[test]
    fn an_instance_is_known_by_its_files() {
        let instance = Instance::new(&format!("known-{}", std::process::id())).expect("valid");
        let node = instance.node().expect("shared memory");
        assert!(instances().contains(&instance));
        // It is in use.
        Instance::default().sweep_dead();
        assert!(instances().contains(&instance));
        drop(node);
        instance.sweep();
        assert!(!instances().contains(&instance));
    }
}
