//! Loads of needles that stay in on the body, for the tissue loop.

use crate::rt::taped;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use stylet_sim::line::{LeftNeedle, LeftShare, MAX_LEFT, MAX_LEFT_LOADS, MAX_STATIONS};

/// Forces of one needle; unused ones are zero.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
pub struct NeedleLoads {
    /// Number of its line.
    pub generation: u64,
    /// Tip along the line in the world, m.
    pub tip_m: f64,
    /// Stations of its line.
    of_line: u32,
    /// Loaded stations of the shaft, and those of the tip with their first index.
    stations: u32,
    tip_first: u32,
    tip_count: u32,
    #[serde(with = "taped")]
    loads_n: [f64; MAX_LEFT_LOADS],
}

impl NeedleLoads {
    fn set(&mut self, needle: &LeftNeedle, share: &LeftShare<'_>) {
        let (first, weights) = share.tip;
        let room = self.loads_n.len() - share.shaft_n.len().min(self.loads_n.len());
        *self = Self {
            generation: share.generation,
            tip_m: needle.held_m(),
            of_line: share.stations as u32,
            stations: share.shaft_n.len() as u32,
            tip_first: first as u32,
            tip_count: weights.len().min(room) as u32,
            loads_n: [0.0; MAX_LEFT_LOADS],
        };
        let all = share
            .shaft_n
            .iter()
            .copied()
            .chain(weights.iter().map(|w| w * share.tip_n));
        for (slot, load_n) in self.loads_n.iter_mut().zip(all) {
            *slot = load_n;
        }
    }

    /// Returns the loads in the order of the line's columns: shaft of each station, then tip at each.
    pub fn of_columns(&self) -> [f64; 2 * MAX_STATIONS] {
        let mut all = [0.0; 2 * MAX_STATIONS];
        let m = self.of_line as usize;
        let (stations, tips) = (self.stations as usize, self.tip_count as usize);
        let loads = self.loads_n.iter().take(stations + tips).enumerate();
        for (n, load_n) in loads {
            let (row, end) = if n < stations {
                (n, m)
            } else {
                (m + self.tip_first as usize + n - stations, 2 * m)
            };
            if let Some(slot) = all[..end.min(2 * MAX_STATIONS)].get_mut(row) {
                *slot = *load_n;
            }
        }
        all
    }

    /// True if some tissue is loaded.
    pub fn is_any(&self) -> bool {
        let count = (self.stations + self.tip_count) as usize;
        self.loads_n.iter().take(count).any(|load_n| *load_n != 0.0)
    }
}

/// Forces of all of them in the newest tick.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, Serialize, Deserialize)]
pub struct LeftLoads {
    count: u64,
    needles: [NeedleLoads; MAX_LEFT],
}

impl LeftLoads {
    /// Returns the needles in the order in which they were left.
    pub fn needles(&self) -> &[NeedleLoads] {
        self.needles.get(..self.count as usize).unwrap_or(&[])
    }

    /// Clears all loads.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Sets the loads of these needles.
    pub fn set<'a>(&mut self, needles: impl Iterator<Item = (&'a LeftNeedle, LeftShare<'a>)>) {
        self.count = 0;
        for (slot, (needle, share)) in self.needles.iter_mut().zip(needles) {
            slot.set(needle, &share);
            self.count += 1;
        }
    }
}

impl Default for LeftLoads {
    fn default() -> Self {
        Self::zeroed()
    }
}
