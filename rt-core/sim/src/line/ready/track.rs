//! Tracks that needles have cut: they stay open for a later needle on another line in the same place.

use super::HandLine;
use crate::line::Line;
use crate::line::stations::NEEDLE_RADIUS_M;
use serde::{Deserialize, Serialize};

/// Track that a needle has cut, with the membranes that it went through.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    line: Line,
    end_m: f64,
    /// One bit for each kind of layer.
    opened: u8,
}

impl HandLine {
    /// Returns the track that the needle has cut so far; `None` where it has cut nothing.
    pub fn track(&self) -> Option<Track> {
        let tip = self.state.tip();
        let opened = self
            .way
            .kinds
            .iter()
            .enumerate()
            .filter(|(n, _)| tip.opened >> n & 1 == 1);
        (tip.track_m > 0.0).then(|| Track {
            line: self.line,
            end_m: tip.track_m,
            opened: opened.fold(0, |bits, (_, (_, kind, _))| bits | 1 << *kind as u8),
        })
    }

    /// Finds `track` open where the needle goes in it all the way, within the radius of a needle; does not allocate.
    /// For a line that no needle is on.
    pub fn open_track(&mut self, track: &Track) {
        let axis = self.line.axes[0];
        let off_m = |along_m: f64| {
            let place_m = track.line.point_m(along_m, [0.0; 2]);
            let from_m = [0, 1, 2].map(|a| place_m[a] - self.line.entry_m[a]);
            let along_m: f64 = (0..3).map(|a| from_m[a] * axis[a]).sum();
            let beside_m: f64 = (0..3).map(|a| (from_m[a] - along_m * axis[a]).powi(2)).sum();
            (along_m, beside_m.sqrt())
        };
        let ((begin_m, beside_begin_m), (end_m, beside_end_m)) = (off_m(0.0), off_m(track.end_m));
        if self.is_in_tissue() || beside_begin_m > NEEDLE_RADIUS_M || beside_end_m > NEEDLE_RADIUS_M || begin_m > end_m
        {
            return;
        }
        let is_open = |(from_m, kind): (f64, u8)| track.opened >> kind & 1 == 1 && from_m <= end_m;
        for (n, (from_m, kind, _)) in self.way.kinds.iter().enumerate() {
            if is_open((*from_m, *kind as u8)) {
                self.state.open_layers |= 1 << n;
            }
        }
        self.state.open_m = self.state.open_m.max(end_m.min(self.model.length_m()));
        self.state.reset();
    }
}
