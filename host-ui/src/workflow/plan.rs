//! One needle through the gland and the seeds along it (paper fig. 6).

use nalgebra::Vector3;
use stylet_shm_schema::{MAX_SEEDS, SceneHeader};

/// The needle begins this far below the gland.
const ENTRY_CLEARANCE_M: f64 = 0.010;
/// The seeds lie between these shares of the needle's way through the gland.
const SEEDED_SHARE: (f64, f64) = (0.2, 0.8);
const SEEDS: usize = 5;

/// The needle's path and the seeds along it, scene frame.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedlePlan {
    pub entry_m: [f64; 3],
    /// Unit vector from the entry into the gland.
    pub direction: [f64; 3],
    /// In the order in which they are dropped: deepest first.
    pub seeds_m: Vec<[f64; 3]>,
}

impl NeedlePlan {
    /// Distance of a point from the entry, along the needle.
    pub fn along_m(&self, point: [f64; 3]) -> f64 {
        (Vector3::from(point) - Vector3::from(self.entry_m)).dot(&Vector3::from(self.direction))
    }

    /// The seeds in the order in which they are dropped.
    pub fn deepest_first(&self) -> Vec<[f64; 3]> {
        let mut seeds = self.seeds_m.clone();
        seeds.sort_by(|a, b| self.along_m(*b).total_cmp(&self.along_m(*a)));
        seeds
    }
}

/// How the scripted hand moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    pub insert_m_per_s: f64,
    pub retract_m_per_s: f64,
    pub approach_m_per_s: f64,
    pub acceleration_m_per_s2: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            insert_m_per_s: 0.05,
            retract_m_per_s: 0.05,
            approach_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
        }
    }
}

/// The patient's inferior-to-superior axis: the perineum, where the needle enters, is inferior.
fn superior_in_scene(scene: &SceneHeader) -> Vector3<f64> {
    // The third row of the rotation is its transpose times +S.
    let row = Vector3::new(
        scene.patient_from_scene[6],
        scene.patient_from_scene[7],
        scene.patient_from_scene[8],
    );
    row.try_normalize(0.5)
        .filter(|d| d.iter().all(|c| c.is_finite()))
        .unwrap_or_else(Vector3::z)
}

/// Five seeds along one needle through the middle of the gland.
pub fn default_plan(scene: &SceneHeader) -> NeedlePlan {
    plan_with_seeds(scene, SEEDS)
}

/// As [`default_plan`], with 1 to [`MAX_SEEDS`] seeds.
pub fn plan_with_seeds(scene: &SceneHeader, seeds: usize) -> NeedlePlan {
    let direction = superior_in_scene(scene);
    let (lower, upper) = (Vector3::from(scene.lower_m), Vector3::from(scene.upper_m));
    let centre = (lower + upper) / 2.0;
    // Half of the needle's way through the bounding box: the nearest pair of faces ends it.
    let half = (0..3)
        .filter(|&a| direction[a].abs() > 1e-9)
        .map(|a| (upper[a] - lower[a]) / 2.0 / direction[a].abs())
        .fold(f64::INFINITY, f64::min);
    let seeds = seeds.clamp(1, MAX_SEEDS);
    let (first, last) = SEEDED_SHARE;
    let seeds_m = (0..seeds)
        .map(|i| {
            let share = if seeds == 1 {
                0.5
            } else {
                last - (last - first) * i as f64 / (seeds - 1) as f64
            };
            (centre + direction * (half * (2.0 * share - 1.0))).into()
        })
        .collect();
    NeedlePlan {
        entry_m: (centre - direction * (half + ENTRY_CLEARANCE_M)).into(),
        direction: direction.into(),
        seeds_m,
    }
}

/// For [`stylet_shm_schema::CommandKind::SetPlan`].
pub fn plan_values(plan: &NeedlePlan) -> Vec<f64> {
    let mut values = [plan.entry_m, plan.direction].concat();
    values.extend(plan.seeds_m.iter().flatten());
    values
}

/// For [`stylet_shm_schema::CommandKind::MoveHand`].
pub fn move_values(target_m: [f64; 3], direction: [f64; 3], speed: f64, acceleration: f64) -> Vec<f64> {
    let mut values = [target_m, direction].concat();
    values.extend([speed, acceleration]);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn scene(patient_from_scene: [f64; 12]) -> SceneHeader {
        let mut scene = SceneHeader::zeroed();
        (scene.lower_m, scene.upper_m) = ([0.02, 0.02, 0.03], [0.06, 0.06, 0.07]);
        scene.patient_from_scene = patient_from_scene;
        scene
    }

    const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

    #[test]
    fn seeds_are_spaced_evenly_inside_the_gland_and_the_entry_is_below_it() {
        let plan = default_plan(&scene(IDENTITY));
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(plan.direction, [0.0, 0.0, 1.0]));
        assert!(near(plan.entry_m, [0.04, 0.04, 0.02]));
        assert_eq!(plan.seeds_m.len(), 5);
        assert!(near(plan.seeds_m[0], [0.04, 0.04, 0.062]));
        assert!(near(plan.seeds_m[4], [0.04, 0.04, 0.038]));
        assert!(near(plan.deepest_first()[0], plan.seeds_m[0]));
        assert_eq!(plan_values(&plan).len(), 21);
    }

    #[test]
    fn the_needle_goes_from_inferior_to_superior_whatever_the_scene_axes_are() {
        // Superior is -y of the scene.
        let plan = default_plan(&scene([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0]));
        assert!((plan.direction[1] + 1.0).abs() < 1e-12);
        assert!(plan.entry_m[1] > 0.06);
        assert_eq!(default_plan(&scene([0.0; 12])).direction, [0.0, 0.0, 1.0]);
    }
}
