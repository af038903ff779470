//! Loads of needles that stay in on the body, for the tissue loop.

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;
use stylet_sim::line::{LeftNeedle, LeftShare, MAX_LEFT, MAX_LEFT_LOADS, MAX_STATIONS};

/// Forces of one needle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
    #[serde(with = "BigArray")]
    loads_n: [f64; MAX_LEFT_LOADS],
}

impl Default for NeedleLoads {
    fn default() -> Self {
        Self {
            generation: 0,
            tip_m: 0.0,
            of_line: 0,
            stations: 0,
            tip_first: 0,
            tip_count: 0,
            loads_n: [0.0; MAX_LEFT_LOADS],
        }
    }
}

impl NeedleLoads {
    fn set(&mut self, needle: &LeftNeedle, share: &LeftShare<'_>) {
        let (first, weights) = share.tip;
        let room = self.loads_n.len() - share.shaft_n.len().min(self.loads_n.len());
        self.generation = share.generation;
        self.tip_m = needle.held_m();
        self.of_line = share.stations as u32;
        self.stations = share.shaft_n.len() as u32;
        (self.tip_first, self.tip_count) = (first as u32, weights.len().min(room) as u32);
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

    fn is_same(&self, other: &Self) -> bool {
        let numbers = |n: &Self| {
            (
                n.generation,
                n.tip_m.to_bits(),
                n.of_line,
                n.stations,
                n.tip_first,
                n.tip_count,
            )
        };
        let count = (self.stations + self.tip_count) as usize;
        let pairs = self.loads_n.iter().zip(&other.loads_n).take(count);
        numbers(self) == numbers(other) && pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits())
    }
}

/// Forces of all of them in the newest tick.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LeftLoads {
    count: u32,
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

    /// Copies the loads in use.
    pub fn copy_from(&mut self, other: &Self) {
        self.count = other.count;
        for (slot, needle) in self.needles.iter_mut().zip(other.needles()) {
            *slot = *needle;
        }
    }

    /// True if every bit is the same.
    pub fn is_same(&self, other: &Self) -> bool {
        self.count == other.count && self.needles().iter().zip(other.needles()).all(|(a, b)| a.is_same(b))
    }
}
