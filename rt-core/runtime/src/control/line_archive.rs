//! Sources of needle lines, kept while a flight recording may need them.

use crate::rt::haptic_tape::HapticFlight;
use crate::rt::tissue_tape::TissueFlight;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stylet_sim::line::{LineSource, LineStations};

/// Longer than any tape: the tissue loop's holds 10 s.
const KEPT: Duration = Duration::from_secs(15);

/// Half of a line, by the loop that uses it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Half {
    Hand,
    Body,
}

struct KeptLine {
    source: LineSource,
    stations: Arc<LineStations>,
    /// When each loop returned its half; `None` while it is in use.
    returned: [Option<Instant>; 2],
}

/// Lines in use, and recently used ones.
#[derive(Default)]
pub(super) struct LineArchive {
    lines: Vec<KeptLine>,
}

impl LineArchive {
    /// Archives a line whose halves go to the loops.
    pub fn keep(&mut self, source: LineSource, stations: Arc<LineStations>) {
        self.drop_old(Instant::now());
        self.lines.push(KeptLine {
            source,
            stations,
            returned: [None; 2],
        });
    }

    /// Records that a loop replaced its half of the line.
    pub fn returned(&mut self, generation: u64, half: Half) {
        for line in self.lines.iter_mut().filter(|l| l.source.generation == generation) {
            line.returned[half as usize] = Some(Instant::now());
        }
    }

    fn drop_old(&mut self, now: Instant) {
        let is_old = |at: &Option<Instant>| at.is_some_and(|at| now.duration_since(at) > KEPT);
        self.lines.retain(|line| !line.returned.iter().all(is_old));
    }

    /// Returns the lines in use: a needle may stay in on any of them.
    pub fn in_use(&self) -> impl Iterator<Item = &Arc<LineStations>> {
        let is_in_use = |line: &&KeptLine| line.returned.iter().any(Option::is_none);
        self.lines.iter().filter(is_in_use).map(|line| &line.stations)
    }

    /// Returns the lines that a recording names.
    pub fn of(&self, haptic: Option<&HapticFlight>, tissue: Option<&TissueFlight>) -> Vec<LineSource> {
        let of_haptic = haptic.into_iter().flat_map(HapticFlight::line_numbers);
        let of_tissue = tissue.into_iter().flat_map(TissueFlight::line_numbers);
        let wanted: Vec<u64> = of_haptic.chain(of_tissue).collect();
        let named = self.lines.iter().filter(|l| wanted.contains(&l.source.generation));
        named.map(|line| line.source.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_sim::line::{HandLine, Line};

    fn source(generation: u64) -> LineSource {
        HandLine::uniform(generation, Line::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap(), 4)
            .unwrap()
            .source()
    }

    /// A line in use may be far older than a tape, and the line before it may still be on the tape.
    #[test]
    fn a_line_is_kept_while_a_loop_has_it_and_for_a_tape_after_that() {
        let mut archive = LineArchive::default();
        let stations = |n| Arc::new(LineStations::none(n));
        archive.keep(source(1), stations(1));
        archive.keep(source(2), stations(2));
        assert_eq!(archive.in_use().count(), 2);
        archive.returned(1, Half::Hand);
        let later = Instant::now() + 2 * KEPT;
        archive.drop_old(later);
        assert_eq!(archive.lines.len(), 2, "the tissue loop has the first");
        archive.returned(1, Half::Body);
        let in_use: Vec<u64> = archive.in_use().map(|stations| stations.generation).collect();
        assert_eq!(in_use, [2]);
        archive.drop_old(Instant::now());
        assert_eq!(archive.lines.len(), 2, "a tape may name it");
        archive.drop_old(later);
        let left: Vec<u64> = archive.lines.iter().map(|l| l.source.generation).collect();
        assert_eq!(left, [2]);
    }
}
