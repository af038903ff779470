//! Seeds that were dropped outside the gland.

use super::{SeedError, Shown};
use nalgebra::Vector3;
use std::fmt;
use stylet_base::format;
use stylet_host::link::{SceneModel, Snapshot};
use stylet_implant::plan::anatomy::Body;
use stylet_shm_schema::{SceneId, SeedPose};
use stylet_surfaces::field::Field;

/// Distance from the edge of the gland up to which seeds are planned.
const EDGE_M: f64 = 1e-3;
/// Length of the search for the gland, longer than a needle.
const SEARCHED_M: f64 = 0.25;

/// Place of a seed outside the gland, along its needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outside {
    /// Distance beyond the gland, m.
    Past(f64),
    /// Distance before the gland, m.
    Before(f64),
    /// The needle misses the gland.
    Aside,
}

impl fmt::Display for Outside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dropped outside the gland, ")?;
        match self {
            Self::Past(m) => write!(f, "{} past it", format::length(*m)),
            Self::Before(m) => write!(f, "{} before it", format::length(*m)),
            Self::Aside => f.write_str("to its side"),
        }
    }
}

/// Places of the seeds in the tissue, in the order of dropping.
#[derive(Clone, Debug, Default)]
pub struct SeedPlaces {
    scene: Option<SceneId>,
    dropped_at_m: Vec<[f64; 3]>,
    /// Place of each seed; `None` in the gland.
    pub places: Vec<Option<Outside>>,
}

impl Shown {
    /// Finds the places of seeds since the last frame. A seed keeps its place in the tissue, so it is looked for once.
    pub fn take_places(&mut self, scene: &SceneModel, snapshot: &Snapshot) {
        let dropped = || self.seeds.iter().map(|seed| seed.dropped_at_m);
        let Some(outlines) = &self.planning.outlines else {
            return;
        };
        let known = &self.seed_places;
        let is_known = known.dropped_at_m.iter().copied().eq(dropped()) && known.scene == Some(outlines.scene);
        if is_known {
            return;
        }
        let Some(field) = Field::of(scene.header.nodes, &snapshot.displacements_m) else {
            return;
        };
        let gland = &outlines.anatomy.target;
        self.seed_places = SeedPlaces {
            scene: Some(outlines.scene),
            dropped_at_m: dropped().collect(),
            places: self.seeds.iter().map(|seed| outside(gland, &field, seed)).collect(),
        };
    }

    /// Returns where the seed of a needle's row lies, if it was dropped outside the gland.
    pub fn outside(&self, needle: usize, row: &SeedError) -> Option<Outside> {
        let progress = &self.planning.progress;
        let first = self
            .planning
            .implant
            .as_ref()
            .map_or(0, |_| progress.seeds_of(needle, self.seeds.len()).start);
        *self.seed_places.places.get(first + row.placed?)?
    }

    /// Returns where the last seed of the present needle lies, if it was dropped outside the gland.
    pub fn last_outside(&self) -> Option<Outside> {
        self.own_seeds().last()?;
        *self.seed_places.places.last()?
    }
}

/// Returns the place of a seed by the gland at rest.
fn outside(gland: &Body, field: &Field, seed: &SeedPose) -> Option<Outside> {
    let at_rest_m: [f64; 3] = field.rest_of_m(Vector3::from(seed.position_m)).into();
    let way_m = |direction: [f64; 3]| {
        let pieces = gland.pieces_m(at_rest_m, direction, SEARCHED_M);
        pieces.first().map(|piece| piece[0])
    };
    let (back_m, ahead_m) = (way_m(seed.axis.map(|c| -c)), way_m(seed.axis));
    let nearest_m = back_m.into_iter().chain(ahead_m).reduce(f64::min);
    if gland.is_near(at_rest_m, seed.axis, EDGE_M) || nearest_m.is_some_and(|m| m <= EDGE_M) {
        return None;
    }
    Some(match nearest_m {
        None => Outside::Aside,
        Some(m) if back_m == Some(m) => Outside::Past(m),
        Some(m) => Outside::Before(m),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_implant::plan::anatomy::ball;

    #[test]
    fn a_seed_past_the_gland_is_named_with_its_distance() {
        let gland = ball("gland", [0.05, 0.05, 0.06], [0.024, 0.018, 0.02]);
        let words = |position_m: [f64; 3]| {
            let seed = SeedPose {
                position_m,
                axis: [0.0, 0.0, 1.0],
                dropped_at_m: position_m,
            };
            outside(&gland, &Field::default(), &seed).map(|place| place.to_string())
        };
        assert_eq!(words([0.05, 0.05, 0.07]), None);
        assert_eq!(words([0.05, 0.05, 0.0805]), None, "at the edge");
        for (position_m, place) in [
            ([0.05, 0.05, 0.0918], "12.0 mm past it"),
            ([0.05, 0.05, 0.0302], "10.0 mm before it"),
            ([0.09, 0.05, 0.060], "to its side"),
        ] {
            let wanted = format!("dropped outside the gland, {place}");
            assert_eq!(words(position_m).as_deref(), Some(&*wanted));
        }
    }
}
