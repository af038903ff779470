//! Progress of the needles: those done, and the seeds of each.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Progress of one needle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeedleState {
    /// Not inserted yet.
    Planned,
    /// In the tissue.
    Inserted,
    /// Out again, with all its seeds dropped.
    Done,
}

impl NeedleState {
    /// Returns its display name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Planned => "planned",
            Self::Inserted => "inserted",
            Self::Done => "done",
        }
    }
}

/// Progress of the needles, which are inserted one after the other in the order of the plan.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NeedleProgress {
    /// Number of seeds in the tissue before each needle that has begun.
    first_seed: Vec<usize>,
    is_done: bool,
    /// Number of seeds in the tissue when the last finished needle was done.
    seeds_when_done: usize,
    /// Drops of a script that left no seed, counted from 0 over all needles.
    #[serde(default)]
    pub lost: Vec<usize>,
}

impl NeedleProgress {
    /// Returns the number of needles that were inserted, those that are done included.
    pub fn begun(&self) -> usize {
        self.first_seed.len()
    }

    /// Returns whether all needles that have begun are done.
    pub fn is_done(&self) -> bool {
        self.begun() > 0 && self.is_done
    }

    /// Returns the number of needles that are done.
    pub fn done(&self) -> usize {
        self.begun() - usize::from(self.begun() > 0 && !self.is_done)
    }

    /// Returns the state of one needle.
    pub fn state(&self, needle: usize) -> NeedleState {
        if needle < self.done() {
            NeedleState::Done
        } else if needle < self.begun() {
            NeedleState::Inserted
        } else {
            NeedleState::Planned
        }
    }

    /// Marks this needle as being inserted, with this number of seeds in the tissue; skipped
    /// needles have no seeds.
    pub fn begin(&mut self, needle: usize, seeds: usize) {
        self.first_seed.resize(needle + 1, seeds);
        self.first_seed[needle] = seeds;
        self.is_done = false;
    }

    /// Marks the inserted needle as done, with this number of seeds in the tissue.
    pub fn finish(&mut self, seeds: usize) {
        if !self.is_done {
            (self.is_done, self.seeds_when_done) = (true, seeds);
        }
    }

    /// Takes the number of seeds in the tissue: a seed that was undone must be dropped again.
    pub fn take(&mut self, seeds: usize) {
        self.is_done &= seeds >= self.seeds_when_done;
    }

    /// Removes the inserted needle from the progress; lost seeds may be dropped again.
    pub fn step_back(&mut self) {
        self.lost.clear();
        if let Some(seeds) = self.first_seed.pop() {
            (self.is_done, self.seeds_when_done) = (true, seeds);
        }
    }

    /// Returns the seeds of a needle, as a range of all seeds in the order of dropping.
    pub fn seeds_of(&self, needle: usize, seeds: usize) -> Range<usize> {
        let from = self.first_seed.get(needle).copied().unwrap_or(seeds).min(seeds);
        let to = self.first_seed.get(needle + 1).copied().unwrap_or(seeds).min(seeds);
        from..to.max(from)
    }

    /// Returns the seeds of the inserted needle, like [`Self::seeds_of`]; all seeds if none is
    /// inserted.
    pub fn own_seeds(&self, seeds: usize) -> Range<usize> {
        match self.begun() {
            0 => 0..seeds,
            n => self.seeds_of(n - 1, seeds),
        }
    }

    /// Returns whether seeds of needles that were done are gone, so that the implantation restarts.
    pub fn is_undone(&self, seeds: usize) -> bool {
        let is_first_undone = self.is_done() && seeds == 0 && self.seeds_when_done > 0;
        is_first_undone || self.first_seed.last().is_some_and(|&first| seeds < first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_needle_has_its_own_seeds() {
        let mut progress = NeedleProgress::default();
        assert_eq!((progress.own_seeds(3), progress.done()), (0..3, 0));
        progress.begin(0, 0);
        assert_eq!(progress.state(0), NeedleState::Inserted);
        assert_eq!(progress.own_seeds(4), 0..4);
        progress.finish(4);
        assert_eq!((progress.state(0), progress.done()), (NeedleState::Done, 1));
        let mut undone = progress.clone();
        undone.take(3);
        assert_eq!((undone.state(0), undone.is_undone(3)), (NeedleState::Inserted, false));
        // A reset after the first needle used to leave it done, so that the second one was next.
        assert!(progress.is_undone(0));
        progress.take(4);
        // The second needle has no seeds and is skipped.
        progress.begin(2, 4);
        assert_eq!(progress.own_seeds(6), 4..6);
        assert_eq!([0, 1, 2].map(|n| progress.seeds_of(n, 6)), [0..4, 4..4, 4..6]);
        assert_eq!(
            [1, 2, 3].map(|n| progress.state(n).name()),
            ["done", "inserted", "planned"]
        );
        assert!(!progress.is_undone(4) && progress.is_undone(3));
        progress.step_back();
        assert_eq!((progress.begun(), progress.done()), (2, 2));
    }
}
