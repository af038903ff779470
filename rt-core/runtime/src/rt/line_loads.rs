//! Forces on a prepared line, for the tissue loop's columns.

use crate::rt::left_loads::LeftLoads;
use serde::{Deserialize, Serialize};
use stylet_sim::line::MAX_STATIONS;
use stylet_sim::line::beam::{BentNeedle, MAX_ACROSS};

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
#[serde(into = "TapedLoads", from = "TapedLoads")]
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
    /// The needle, if it bends.
    pub bent: Option<BentTip>,
    /// Stations across; none for a needle that does not bend.
    pub across: usize,
    /// Number of `loads_n` in use.
    pub count: usize,
    /// Shaft of each station, then tip at each, then stations across in each direction.
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

    fn bits(&self) -> [u64; 20] {
        let n = &self.needle;
        let pairs = [
            n.grip,
            n.hand_m,
            n.hand_slope,
            n.hole_n,
            n.tip_n,
            self.across_m,
            self.displacement_m,
        ];
        let own = [
            n.bending_stiffness_n_m2,
            n.length_m,
            n.tip_m,
            n.hole_m,
            n.first_m,
            n.spacing_m,
        ];
        let mut all = [0; 20];
        let values = pairs.iter().flatten().chain(&own);
        all.iter_mut()
            .zip(values)
            .for_each(|(slot, value)| *slot = value.to_bits());
        all
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

    /// True if every bit is the same.
    pub fn is_same(&self, other: &Self) -> bool {
        let bits = |loads: &Self| {
            (
                loads.generation,
                loads.in_tissue,
                loads.tip_material_m.to_bits(),
                loads.tip_displacement_m.to_bits(),
                loads.whole_m.to_bits(),
                loads.bent.map(|bent| bent.bits()),
                loads.across,
                loads.count,
            )
        };
        let pairs = self.loads_n().iter().zip(other.loads_n());
        bits(self) == bits(other) && pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits())
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
            bent: None,
            across: 0,
            count: 0,
            loads_n: [0.0; MOST],
        }
    }
}

/// Loads as stored in a flight recording: few stations are in contact.
#[derive(Serialize, Deserialize)]
struct TapedLoads {
    generation: u64,
    in_tissue: bool,
    tip_material_m: f64,
    tip_displacement_m: f64,
    whole_m: f64,
    bent: Option<BentTip>,
    across: usize,
    count: usize,
    /// Nonzero loads, each with its index.
    loads_n: Vec<(u16, f64)>,
}

impl From<LineLoads> for TapedLoads {
    fn from(loads: LineLoads) -> Self {
        let numbered = (0_u16..).zip(loads.loads_n().iter().copied());
        Self {
            generation: loads.generation,
            in_tissue: loads.in_tissue,
            tip_material_m: loads.tip_material_m,
            tip_displacement_m: loads.tip_displacement_m,
            whole_m: loads.whole_m,
            bent: loads.bent,
            across: loads.across,
            count: loads.count,
            loads_n: numbered.filter(|(_, load_n)| load_n.to_bits() != 0).collect(),
        }
    }
}

impl From<TapedLoads> for LineLoads {
    /// Indices outside any line are dropped.
    fn from(taped: TapedLoads) -> Self {
        let mut loads = Self {
            generation: taped.generation,
            in_tissue: taped.in_tissue,
            tip_material_m: taped.tip_material_m,
            tip_displacement_m: taped.tip_displacement_m,
            whole_m: taped.whole_m,
            bent: taped.bent,
            across: taped.across.min(MAX_ACROSS),
            count: taped.count.min(MOST),
            ..Self::default()
        };
        for (place, load_n) in taped.loads_n {
            if let Some(slot) = loads.loads_n.get_mut(usize::from(place)) {
                *slot = load_n;
            }
        }
        loads
    }
}
