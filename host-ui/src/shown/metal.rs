//! Seeds and needles as pictures of the body take them.

use super::Shown;
use nalgebra::Vector3;
use stylet_imaging::{Metal, Needle, Seed};

/// So much of a needle is drawn, m.
const NEEDLE_M: f64 = 0.15;

impl Shown {
    /// All metal as it lies now.
    pub fn metal(&self) -> Metal {
        let seeds = self.seeds.iter().map(|seed| Seed {
            middle_m: self.drawn_at_m(seed).into(),
            axis: seed.axis.into(),
        });
        let left = self.left.iter().map(|left| {
            let tip = Vector3::from(left.tip_m);
            vec![tip, tip - Vector3::from(left.direction) * NEEDLE_M]
        });
        let moving = self.needle_points_m(NEEDLE_M);
        let moving = moving.map(|points| points.into_iter().map(Vector3::from).collect());
        Metal {
            seeds: seeds.collect(),
            needles: left.chain(moving).map(|points_m| Needle { points_m }).collect(),
        }
    }
}
