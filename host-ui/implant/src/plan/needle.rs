//! One needle of a plan: where it goes in, how deep, and which seeds it leaves.

use super::template::Hole;
use nalgebra::Vector3;

/// From end to end of a seed.
pub const SEED_LENGTH_M: f64 = 4.5e-3;
/// The usual spacer between two seeds of a strand; seeds then lie 10 mm apart.
pub const SPACER_M: f64 = 5.5e-3;

/// How the seeds of a needle hang together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loading {
    /// Each by itself.
    Loose,
    /// In one strand, with spacers of one length between them: they move together.
    Stranded {
        /// From the end of a seed to the next one, m.
        spacer_m: f64,
    },
}

impl Loading {
    /// From middle to middle of two seeds of a strand.
    pub fn pitch_m(self) -> Option<f64> {
        match self {
            Self::Loose => None,
            Self::Stranded { spacer_m } => Some(SEED_LENGTH_M + spacer_m),
        }
    }
}

/// A seed on its needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeedleSeed {
    /// From the entry, along the needle.
    pub along_m: f64,
    /// Air kerma strength.
    pub strength_u: f64,
}

/// A needle, scene frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Needle {
    /// `None` for one that is held by hand.
    pub hole: Option<Hole>,
    /// Where the tip starts, outside the body.
    pub entry_m: [f64; 3],
    /// Unit vector into the body.
    pub direction: [f64; 3],
    /// How far from the entry the tip goes.
    pub depth_m: f64,
    /// How far from the entry the tip is drawn back to when its seeds are out; 0: to the entry.
    pub retract_to_m: f64,
    /// Whether its seeds are loose or stranded.
    pub loading: Loading,
    /// Deepest first: the order in which they are dropped.
    pub seeds: Vec<NeedleSeed>,
}

impl Needle {
    /// The place at a distance from the entry, m.
    pub fn at_m(&self, along_m: f64) -> [f64; 3] {
        [0, 1, 2].map(|a| self.entry_m[a] + self.direction[a] * along_m)
    }

    /// Distance of a point from the entry, along the needle, m.
    pub fn along_m(&self, point_m: [f64; 3]) -> f64 {
        (Vector3::from(point_m) - Vector3::from(self.entry_m)).dot(&Vector3::from(self.direction))
    }

    /// Where its seeds are planned, deepest first.
    pub fn seeds_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.seeds.iter().map(|s| self.at_m(s.along_m))
    }

    /// With the seeds in the order in which they are dropped and the tip as deep as the deepest.
    pub fn in_order(mut self) -> Self {
        self.seeds.sort_by(|a, b| b.along_m.total_cmp(&a.along_m));
        self.depth_m = self.seeds.first().map_or(self.depth_m, |s| s.along_m);
        self
    }

    /// A strand of so many seeds, its first one at `first_along_m`.
    pub fn strand(count: usize, first_along_m: f64, spacer_m: f64, strength_u: f64) -> Vec<NeedleSeed> {
        let pitch_m = SEED_LENGTH_M + spacer_m;
        let seed = |i: usize| NeedleSeed {
            along_m: first_along_m - i as f64 * pitch_m,
            strength_u,
        };
        (0..count).map(seed).collect()
    }
}
