//! One needle of a plan: its entry, its depth, and its seeds.

use super::template::Hole;
use nalgebra::Vector3;
use stylet_dose::Seed;
pub use stylet_shm_schema::{SEED_LENGTH_M, TOUCHING_M};

/// Usual spacer between two seeds of a strand; seeds then lie 10 mm apart.
pub const SPACER_M: f64 = 5.5e-3;

/// Connection of a needle's seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loading {
    /// Single seeds.
    Loose,
    /// One strand, with spacers of one length between the seeds: they move together.
    Stranded {
        /// Distance from the end of a seed to the next one, m.
        spacer_m: f64,
    },
}

impl Loading {
    /// Returns the distance from centre to centre of two seeds of a strand.
    pub fn pitch_m(self) -> Option<f64> {
        match self {
            Self::Loose => None,
            Self::Stranded { spacer_m } => Some(SEED_LENGTH_M + spacer_m),
        }
    }
}

/// Seed on its needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeedleSeed {
    /// Distance from the entry, along the needle.
    pub along_m: f64,
    /// Air kerma strength.
    pub strength_u: f64,
}

/// Needle in the scene frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Needle {
    /// Hole of the template; `None` for one held by hand.
    pub hole: Option<Hole>,
    /// Start of the tip, outside the body.
    pub entry_m: [f64; 3],
    /// Unit vector into the body.
    pub direction: [f64; 3],
    /// Depth of the deepest seed's middle from the entry; the tip goes half a seed deeper.
    pub depth_m: f64,
    /// Distance from the entry to which the tip is drawn back after the last drop; 0: to the entry.
    pub retract_to_m: f64,
    /// Connection of its seeds.
    pub loading: Loading,
    /// Seeds, deepest first: in the order of dropping.
    pub seeds: Vec<NeedleSeed>,
}

impl Needle {
    /// Returns the place at a distance from the entry, m.
    pub fn at_m(&self, along_m: f64) -> [f64; 3] {
        [0, 1, 2].map(|a| self.entry_m[a] + self.direction[a] * along_m)
    }

    /// Returns the distance of a point from the entry, along the needle, m.
    pub fn along_m(&self, point_m: [f64; 3]) -> f64 {
        (Vector3::from(point_m) - Vector3::from(self.entry_m)).dot(&Vector3::from(self.direction))
    }

    /// Returns the depth of the tip at the deepest drop.
    pub fn tip_m(&self) -> f64 {
        self.depth_m + 0.5 * SEED_LENGTH_M
    }

    /// Returns the planned places of its seeds, deepest first.
    pub fn seeds_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.seeds.iter().map(|s| self.at_m(s.along_m))
    }

    /// Returns the seeds at their planned places for dose computation, deepest first.
    pub fn dose_seeds(&self) -> impl Iterator<Item = Seed> + '_ {
        self.seeds.iter().map(|s| Seed {
            position_m: self.at_m(s.along_m),
            axis: Some(self.direction),
            strength_u: s.strength_u,
        })
    }

    /// Sorts the seeds in the order of dropping, and sets the depth to that of the deepest.
    pub fn in_order(mut self) -> Self {
        self.seeds.sort_by(|a, b| b.along_m.total_cmp(&a.along_m));
        self.depth_m = self.seeds.first().map_or(self.depth_m, |s| s.along_m);
        self
    }

    /// Returns a strand of this number of seeds, its first one at `first_along_m`.
    pub fn strand(count: usize, first_along_m: f64, spacer_m: f64, strength_u: f64) -> Vec<NeedleSeed> {
        let pitch_m = SEED_LENGTH_M + spacer_m;
        let seed = |i: usize| NeedleSeed {
            along_m: first_along_m - i as f64 * pitch_m,
            strength_u,
        };
        (0..count).map(seed).collect()
    }
}
