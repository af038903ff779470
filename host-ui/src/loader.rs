//! Reads a segmented volume on a thread of its own, so that a large or broken file never holds up a frame.

use crate::files::LabelVolume;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

type Outcome = Result<LabelVolume, String>;

/// One file at a time.
#[derive(Default)]
pub struct Loader {
    reading: Option<(PathBuf, Receiver<Outcome>)>,
}

impl Loader {
    pub fn begin(&mut self, path: &Path, label: Option<u8>) {
        let (sender, receiver) = channel();
        let owned = path.to_owned();
        let spawned = std::thread::Builder::new()
            .name("scene reader".to_owned())
            .spawn(move || {
                // The window may be gone by now; then nobody wants the answer.
                let _ = sender.send(read(&owned, label));
            });
        // When no thread can be had the sender is gone and `poll` says so.
        drop(spawned);
        self.reading = Some((path.to_owned(), receiver));
    }

    /// What is being read is no longer wanted; its thread ends by itself.
    pub fn cancel(&mut self) {
        self.reading = None;
    }

    /// Each outcome once; a reader that died is a refusal too.
    pub fn poll(&mut self) -> Option<Outcome> {
        let (path, receiver) = self.reading.as_ref()?;
        let outcome = match receiver.try_recv() {
            Ok(outcome) => outcome,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => Err(format!("{}: the reader stopped half-way", path.display())),
        };
        self.reading = None;
        Some(outcome)
    }
}

fn read(path: &Path, label: Option<u8>) -> Outcome {
    crate::files::read(path, label).map_err(|e| e.to_string())
}
