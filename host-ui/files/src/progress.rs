//! Progress of reading a file, for another thread, which may also cancel it.

use crate::error::ContentError;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use stylet_base::interrupt::Interrupt;

/// Stage of reading a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading the bytes of the file.
    Bytes,
    /// Extracting voxels from the bytes.
    Voxels,
    /// Making elements from the voxels.
    Elements,
}

impl Stage {
    const ALL: [Self; 3] = [Self::Bytes, Self::Voxels, Self::Elements];

    /// Returns the display name of the stage.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bytes => "reading the file",
            Self::Voxels => "reading voxels",
            Self::Elements => "making elements",
        }
    }
}

/// Resolution of a reported share.
const STEPS: u32 = 1000;

/// Progress of one reading; clones share it.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    at: Arc<AtomicU32>,
    end: Interrupt,
}

impl Progress {
    /// Returns the same progress, which ends once `end` is requested.
    pub fn ended_by(self, end: Interrupt) -> Self {
        Self { end, ..self }
    }

    /// Reports progress from the reader; returns an error if the user cancelled the work.
    pub fn report(&self, stage: Stage, done: usize, of: usize) -> Result<(), ContentError> {
        let steps = (done as f64 / of.max(1) as f64).min(1.0) * f64::from(STEPS);
        // SYNC: read by `at`; only the number is carried.
        self.at
            .store(stage as u32 * (STEPS + 1) + steps as u32, Ordering::Relaxed);
        if self.end.asked() {
            return Err(ContentError::Cancelled);
        }
        Ok(())
    }

    /// Returns the stage, and its completed share.
    pub fn at(&self) -> (Stage, f32) {
        // SYNC: stored by `report`; only the number is carried.
        let at = self.at.load(Ordering::Relaxed);
        let stage = Stage::ALL.get((at / (STEPS + 1)) as usize);
        let share = (at % (STEPS + 1)) as f32 / STEPS as f32;
        (stage.copied().unwrap_or(Stage::Bytes), share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_thread_sees_the_progress_of_another_and_can_end_it() {
        let end = Interrupt::default();
        let seen = Progress::default();
        assert_eq!(seen.at(), (Stage::Bytes, 0.0));
        let reader = seen.clone().ended_by(end.clone());
        for (stage, done, of, share) in [
            (Stage::Bytes, 7, 7, 1.0),
            (Stage::Voxels, 1, 4, 0.25),
            (Stage::Elements, 0, 0, 0.0),
            (Stage::Elements, 9, 3, 1.0),
        ] {
            assert_eq!(reader.report(stage, done, of), Ok(()));
            assert_eq!(seen.at(), (stage, share));
        }
        end.ask();
        assert!(reader.report(Stage::Voxels, 1, 4).is_err());
    }
}
