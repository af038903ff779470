//! Reads a segmented volume on a thread of its own, so that a large or broken file never holds up a frame.

use crate::files::LabelVolume;
use crate::job::{Job, News};
use std::path::{Path, PathBuf};

type Outcome = Result<LabelVolume, String>;

/// One file at a time.
#[derive(Default)]
pub struct Loader {
    reading: Option<(PathBuf, Job<Outcome>)>,
}

impl Loader {
    pub fn begin(&mut self, path: &Path, label: Option<u8>) {
        let owned = path.to_owned();
        let job = Job::begin("scene reader", move |told, _| {
            // The window may be gone by now; then nobody wants the answer.
            let _ = told.send(crate::files::read(&owned, label).map_err(|e| e.to_string()));
        });
        self.reading = Some((path.to_owned(), job));
    }

    /// What is being read is no longer wanted; its thread ends by itself.
    pub fn cancel(&mut self) {
        self.reading = None;
    }

    /// Each outcome once; a reader that died is a refusal too.
    pub fn poll(&mut self) -> Option<Outcome> {
        let (path, job) = self.reading.as_ref()?;
        let outcome = match job.poll() {
            News::None => return None,
            News::Told(outcome) => outcome,
            News::Ended => Err(format!("{}: the reader stopped half-way", path.display())),
        };
        self.reading = None;
        Some(outcome)
    }
}
