//! A seed in the tissue: material points that move with the body.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_shm_schema::SeedPose;
use stylet_sim::tissue::{Deformed, MaterialPoint};

/// A seed left in the tissue.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Seed {
    /// Where the tip of the needle was.
    pub tip: MaterialPoint,
    /// The other end; `None` where that was outside the tissue.
    pub tail: Option<MaterialPoint>,
    /// Direction of the needle at the drop, unit vector; the axis where the tail is unknown.
    pub axis: [f64; 3],
    /// Place of the tip at the drop, scene frame, m.
    pub dropped_at_m: [f64; 3],
}

impl Seed {
    /// Place and axis in the deformed body, scene frame.
    pub fn pose(&self, body: &Deformed<'_>) -> SeedPose {
        let position_m = self.tip.position_m(body);
        let along = self
            .tail
            .map(|tail| Vector3::from(position_m) - Vector3::from(tail.position_m(body)));
        let axis = along.and_then(|a| a.try_normalize(1e-9)).map_or(self.axis, Into::into);
        SeedPose {
            position_m,
            axis,
            dropped_at_m: self.dropped_at_m,
        }
    }
}
