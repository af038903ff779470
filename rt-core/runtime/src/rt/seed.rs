//! Seeds in the tissue: material points that move with the body, and inextensible strands of them.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use stylet_shm_schema::{SEED_LENGTH_M, SeedPose};
use stylet_sim::tissue::{Deformed, MaterialPoint};

/// A seed left in the tissue.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Seed {
    /// Its deeper end.
    pub tip: MaterialPoint,
    /// The other end; `None` if it was outside the tissue.
    pub tail: Option<MaterialPoint>,
    /// Direction of the needle at the drop, unit vector; the axis if the tail is unknown.
    pub axis: [f64; 3],
    /// Middle of the seed at the drop, scene frame, m.
    pub dropped_at_m: [f64; 3],
    /// Pitch to the seed before it, centre to centre, m, if a spacer joins them.
    pub strand_pitch_m: Option<f64>,
    /// Direction towards the entry along the open track that it lies in, unit vector at rest; `None` if there is none.
    pub track_to_entry: Option<[f64; 3]>,
}

/// Returns positions and axes in the deformed body, scene frame, in the order of the drops.
///
/// A strand bends and does not stretch: along it each seed keeps its pitch, at the balance of equal springs between
/// each seed and its own place in the tissue (docs/physics.md, Strands). The effect on the tissue is neglected.
pub fn poses<'a>(seeds: &'a [Seed], body: Deformed<'a>) -> impl Iterator<Item = SeedPose> + 'a {
    let strands = seeds.chunk_by(|_, next| next.strand_pitch_m.is_some());
    strands.flat_map(move |strand| {
        let axis: Vector3<f64> = strand.first().map_or_else(Vector3::zeros, |first| first.axis.into());
        let in_tissue = move || {
            let mut behind_m = 0.0;
            strand.iter().enumerate().map(move |(number, seed)| {
                behind_m += seed.strand_pitch_m.filter(|_| number > 0).unwrap_or(0.0);
                (seed.pose(&body), behind_m)
            })
        };
        let along_m = move |(pose, behind_m): &(SeedPose, f64)| axis.dot(&Vector3::from(pose.position_m)) + behind_m;
        let first_m = in_tissue().map(|seed| along_m(&seed)).sum::<f64>() / strand.len() as f64;
        in_tissue().map(move |seed| SeedPose {
            position_m: (Vector3::from(seed.0.position_m) + axis * (first_m - along_m(&seed))).into(),
            ..seed.0
        })
    })
}

impl Seed {
    /// Position and axis of a single seed in the deformed body, scene frame.
    fn pose(&self, body: &Deformed<'_>) -> SeedPose {
        let tip_m = Vector3::from(self.tip.position_m(body));
        let tail_m = self.tail.map(|tail| Vector3::from(tail.position_m(body)));
        let axis = tail_m.and_then(|tail_m| (tip_m - tail_m).try_normalize(1e-9));
        let axis = axis.unwrap_or_else(|| self.axis.into());
        let middle_m = tail_m.map_or_else(|| tip_m - axis * (0.5 * SEED_LENGTH_M), |tail_m| 0.5 * (tip_m + tail_m));
        SeedPose {
            position_m: middle_m.into(),
            axis: axis.into(),
            dropped_at_m: self.dropped_at_m,
        }
    }
}
