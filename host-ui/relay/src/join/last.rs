//! The last record that hosts here received, saved for a member that is killed and restarted: it requests the records
//! made meanwhile.

use crate::RelayError;
use std::fs::File;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::PathBuf;
use stylet_shm_schema::Instance;

/// Time for which servers keep records.
const KEPT_NS: u64 = 60_000_000_000;
const LENGTH: usize = 24;

/// The next tick in a run of the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Next {
    pub session_id: u64,
    pub tick: u64,
}

/// The file. A member that ends removes it, since hosts of a later one have no gap to fill.
pub(super) struct Last {
    file: File,
    path: PathBuf,
}

impl Last {
    /// Opens the file for the member of `instance`, and returns the note of one killed less than a minute ago.
    pub fn open(instance: &Instance, now_ns: u64) -> Result<(Self, Option<Next>), RelayError> {
        let folder = instance.make_folder()?;
        let path = folder.join("relay.last");
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let file = options.open(&path).map_err(|why| RelayError::File {
            path: path.clone(),
            why,
        })?;
        let last = Self { file, path };
        let noted = last.noted(now_ns);
        Ok((last, noted))
    }

    fn noted(&self, now_ns: u64) -> Option<Next> {
        let mut bytes = [0; LENGTH];
        self.file.read_exact_at(&mut bytes, 0).ok()?;
        let [session_id, tick, time_ns]: [u64; 3] = bytemuck::pod_read_unaligned(&bytes);
        // After a reboot the noted time may be ahead of the clock.
        let is_recent = now_ns.checked_sub(time_ns).is_some_and(|age_ns| age_ns < KEPT_NS);
        is_recent.then_some(Next { session_id, tick })
    }

    /// Notes that hosts here have all records before `next`.
    pub fn note(&self, next: Next, now_ns: u64) {
        // Without the file, a killed member only loses the records made meanwhile.
        let _ = self
            .file
            .write_all_at(bytemuck::bytes_of(&[next.session_id, next.tick, now_ns]), 0);
    }
}

impl Drop for Last {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_valid_note_younger_than_a_minute_is_found() {
        let instance = Instance::new(&format!("last-{}", std::process::id())).expect("valid");
        let next = Next {
            session_id: 7,
            tick: 1234,
        };
        let now_ns = 5 * KEPT_NS;
        let (killed, before) = Last::open(&instance, now_ns).expect("shared memory");
        assert_eq!(before, None);
        killed.note(next, now_ns);
        std::mem::forget(killed);
        for (later_ns, found) in [(0, Some(next)), (KEPT_NS, None)] {
            let (again, before) = Last::open(&instance, now_ns + later_ns).expect("shared memory");
            assert_eq!(before, found);
            std::mem::forget(again);
        }
        let (ended, _) = Last::open(&instance, now_ns).expect("shared memory");
        ended.file.set_len(9).expect("ours");
        let (same, before) = Last::open(&instance, now_ns).expect("shared memory");
        assert_eq!(before, None, "too short");
        drop((ended, same));
        assert_eq!(Last::open(&instance, now_ns).expect("shared memory").1, None);
        instance.sweep();
    }
}
