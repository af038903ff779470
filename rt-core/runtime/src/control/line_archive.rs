//! Sources of needle lines, kept while a flight recording may need them.

use crate::rt::haptic_tape::HapticFlight;
use crate::rt::tissue_tape::TissueFlight;
use std::sync::Arc;
use stylet_sim::line::{LineSource, LineStations};

/// Longer than any tape: the tissue loop's holds 10 s.
const KEPT_NS: u64 = 15_000_000_000;

/// Half of a line, by the loop that uses it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Half {
    Hand,
    Body,
}

struct KeptLine {
    source: LineSource,
    stations: Arc<LineStations>,
    /// When each loop returned its half, ns; `None` while it is in use.
    returned_ns: [Option<u64>; 2],
}

/// Lines in use, and recently used ones.
#[derive(Default)]
pub(super) struct LineArchive {
    lines: Vec<KeptLine>,
}

impl LineArchive {
    /// Archives a line whose halves go to the loops.
    pub fn keep(&mut self, source: LineSource, stations: Arc<LineStations>, now_ns: u64) {
        self.drop_old(now_ns);
        self.lines.push(KeptLine {
            source,
            stations,
            returned_ns: [None; 2],
        });
    }

    /// Records that a loop replaced its half of the line.
    pub fn returned(&mut self, generation: u64, half: Half, now_ns: u64) {
        for line in self.lines.iter_mut().filter(|l| l.source.generation == generation) {
            line.returned_ns[half as usize] = Some(now_ns);
        }
    }

    fn drop_old(&mut self, now_ns: u64) {
        let is_old = |at: &Option<u64>| at.is_some_and(|at_ns| now_ns.saturating_sub(at_ns) > KEPT_NS);
        self.lines.retain(|line| !line.returned_ns.iter().all(is_old));
    }

    /// Returns the lines in use: a needle may stay in on any of them.
    pub fn in_use(&self) -> impl Iterator<Item = &Arc<LineStations>> {
        let is_in_use = |line: &&KeptLine| line.returned_ns.iter().any(Option::is_none);
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
        archive.keep(source(1), stations(1), 0);
        archive.keep(source(2), stations(2), 0);
        assert_eq!(archive.in_use().count(), 2);
        archive.returned(1, Half::Hand, 1);
        let later_ns = 2 * KEPT_NS;
        archive.drop_old(later_ns);
        assert_eq!(archive.lines.len(), 2, "the tissue loop has the first");
        archive.returned(1, Half::Body, 2);
        let in_use: Vec<u64> = archive.in_use().map(|stations| stations.generation).collect();
        assert_eq!(in_use, [2]);
        archive.drop_old(3);
        assert_eq!(archive.lines.len(), 2, "a tape may name it");
        archive.drop_old(later_ns);
        let left: Vec<u64> = archive.lines.iter().map(|l| l.source.generation).collect();
        assert_eq!(left, [2]);
    }
}
