//! Forces on a prepared line, for the tissue loop's columns.

use crate::rt::left_loads::LeftLoads;
use crate::rt::taped;
use serde::{Deserialize, Serialize};
use stylet_sim::line::beam::{BentNeedle, MAX_ACROSS};
use stylet_sim::line::{MAX_STATIONS, SeedHold};

/// Shaft and tip of each station, and stations across along both directions.
pub(crate) const MOST: usize = 2 * MAX_STATIONS + 2 * MAX_ACROSS;

/// Forces of all needles in the newest tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct AllLoads {
    /// Loads of the moving needle.
    pub line: LineLoads,
    /// Loads of needles that stay in.
    pub left: LeftLoads,
}

/// Forces of the newest tick on a line.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct LineLoads {
    /// Generation of their line; 0 if the needle is on none.
    pub generation: u64,
    /// The tip presses on tissue or is in it.
    pub in_tissue: bool,
    /// Rest position of the material at the tip, from the entry along the line, m.
    pub tip_material_m: f64,
    /// Displacement of that material along the line, m.
    pub tip_displacement_m: f64,
    /// Additional displacement of the whole body along the line, m.
    pub whole_m: f64,
    /// Hold of that material on a seed in the track.
    pub hold: SeedHold,
    /// The needle, if it bends.
    pub bent: Option<BentTip>,
    /// Stations across; none for a needle that does not bend.
    pub across: usize,
    /// Number of `loads_n` in use.
    pub count: usize,
    /// Shaft of each station, then tip at each, then stations across in each direction.
    #[serde(with = "taped")]
    pub loads_n: [f64; MOST],
}

/// A bent needle and the material at its tip.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BentTip {
    /// The needle.
    pub needle: BentNeedle,
    /// Tip across the line, in the world, m.
    pub across_m: [f64; 2],
    /// Displacement of the tissue at the tip across the line, m.
    pub displacement_m: [f64; 2],
}

impl BentTip {
    /// Rest position of the material at the tip, across the line, m.
    pub fn material_m(&self) -> [f64; 2] {
        [0, 1].map(|side| self.across_m[side] - self.displacement_m[side])
    }
}

impl LineLoads {
    /// Returns the forces in use.
    pub fn loads_n(&self) -> &[f64] {
        self.loads_n.get(..self.count).unwrap_or(&[])
    }

    /// Returns the forces across the line on each station across, in both directions.
    pub fn across_n(&self) -> [&[f64]; 2] {
        let loads_n = self.loads_n();
        let (_, across) = loads_n.split_at(loads_n.len().saturating_sub(2 * self.across));
        across
            .split_at_checked(self.across)
            .map_or([&[], &[]], |(first, second)| [first, second])
    }

    /// Deflection of a point of the needle from a rigid one, in both directions across, m; 0 without a beam.
    pub fn deflection_m(&self, behind_tip_m: f64) -> [f64; 2] {
        self.bent.map_or([0.0; 2], |bent| {
            bent.needle
                .deflection_m(bent.needle.tip_m - behind_tip_m, self.across_n())
        })
    }

    /// True if some tissue is loaded.
    pub fn is_any(&self) -> bool {
        self.loads_n().iter().any(|load_n| *load_n != 0.0)
    }
}

impl Default for LineLoads {
    fn default() -> Self {
        Self {
            generation: 0,
            in_tissue: false,
            tip_material_m: 0.0,
            tip_displacement_m: 0.0,
            whole_m: 0.0,
            hold: SeedHold::default(),
            bent: None,
            across: 0,
            count: 0,
            loads_n: [0.0; MOST],
        }
    }
}
