//! How far the reading of a file is, for another thread, which may also end it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use stylet_base::interrupt::Interrupt;

/// What is being done with a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    Bytes,
    Voxels,
    Elements,
}

impl Stage {
    const ALL: [Self; 3] = [Self::Bytes, Self::Voxels, Self::Elements];

    pub fn name(self) -> &'static str {
        match self {
            Self::Bytes => "reading the file",
            Self::Voxels => "reading voxels",
            Self::Elements => "making elements",
        }
    }
}

/// Steps in which a share is told.
const STEPS: u32 = 1000;

/// Clones tell of the same reading.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    at: Arc<AtomicU32>,
    end: Interrupt,
}

impl Progress {
    /// The same reading, ended when this is asked for.
    pub fn ended_by(self, end: Interrupt) -> Self {
        Self { end, ..self }
    }

    /// From the reader, now and then; `Err` when it is to end.
    pub fn tell(&self, stage: Stage, done: usize, of: usize) -> Result<(), String> {
        let steps = (done as f64 / of.max(1) as f64).min(1.0) * f64::from(STEPS);
        // SYNC: read by `at`; nothing but the number is carried.
        self.at
            .store(stage as u32 * (STEPS + 1) + steps as u32, Ordering::Relaxed);
        if self.end.asked() {
            return Err("it was cancelled".to_owned());
        }
        Ok(())
    }

    /// The stage, and the share of it that is done.
    pub fn at(&self) -> (Stage, f32) {
        // SYNC: told by `tell`; nothing but the number is carried.
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
    fn what_one_thread_tells_another_sees_and_what_it_asks_ends_the_work() {
        let end = Interrupt::default();
        let seen = Progress::default();
        assert_eq!(seen.at(), (Stage::Bytes, 0.0));
        let told = seen.clone().ended_by(end.clone());
        for (stage, done, of, share) in [
            (Stage::Bytes, 7, 7, 1.0),
            (Stage::Voxels, 1, 4, 0.25),
            (Stage::Elements, 0, 0, 0.0),
            (Stage::Elements, 9, 3, 1.0),
        ] {
            assert_eq!(told.tell(stage, done, of), Ok(()));
            assert_eq!(seen.at(), (stage, share));
        }
        end.ask();
        assert!(told.tell(Stage::Voxels, 1, 4).is_err());
    }
}
