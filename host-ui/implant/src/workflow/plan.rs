//! One needle through the gland and the seeds along it (paper fig. 6).

use crate::patient::{Box3, patient_axis};
use nalgebra::Vector3;
use stylet_shm_schema::{HandMove, MAX_SEEDS, PlannedNeedle, Prescribed, Request, SceneHeader, StructureInfo, role};

/// Distance of the needle's start from the body.
const ENTRY_CLEARANCE_M: f64 = 0.010;
/// Range of the seeds, as shares of the needle's path through the gland.
const SEEDED_SHARE: (f64, f64) = (0.2, 0.8);
const SEEDS: usize = 5;
/// Distance of the needle from the boxes around urethra, rectum and bladder.
const SPARED_M: f64 = 0.005;
/// Distance of the places tried beside the centre of the target: half the pitch of a usual
/// template.
const ASIDE_M: f64 = 0.0025;

/// Plans five seeds along one needle through the centre of the target.
pub fn default_plan(scene: &SceneHeader) -> PlannedNeedle {
    plan_with_seeds(scene, SEEDS)
}

/// Like [`default_plan`], with 1 to [`MAX_SEEDS`] seeds, deepest first. The needle comes from the perineum, which
/// is inferior; if a spared structure is in its way, it avoids the centre.
pub fn plan_with_seeds(scene: &SceneHeader, seeds: usize) -> PlannedNeedle {
    let direction = patient_axis(scene, 2, Vector3::z());
    let target = Box3::of(scene.target_lower_m, scene.target_upper_m);
    let body = Box3::of(scene.lower_m, scene.upper_m);
    let half = target.way_out_m(target.middle(), direction);
    let (first, last) = SEEDED_SHARE;
    let deepest_m = half * (2.0 * last - 1.0);
    let out_m = body.way_out_m(target.middle(), -direction) + ENTRY_CLEARANCE_M;
    let candidates = candidate_centres(scene, &target, direction);
    let is_clear = |through: &Vector3<f64>| {
        let spared = scene.structures().iter().filter(|s| s.role & role::SPARE != 0);
        spared
            .map(around)
            .all(|b| !b.is_met(*through, direction, [-out_m, deepest_m]))
    };
    let centre = candidates.into_iter().find(is_clear).unwrap_or(target.middle());
    let seeds = seeds.clamp(1, MAX_SEEDS);
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
    PlannedNeedle {
        entry_m: (centre - direction * out_m).into(),
        direction: direction.into(),
        seeds_m,
        prescribed: Prescribed::default(),
    }
}

/// Returns the centre of the target, then places to its left and right, the nearest first, to
/// half-way to its side.
fn candidate_centres(scene: &SceneHeader, target: &Box3, direction: Vector3<f64>) -> Vec<Vector3<f64>> {
    let right = patient_axis(scene, 0, Vector3::x());
    let Some(aside) = (right - direction * right.dot(&direction)).try_normalize(1e-3) else {
        return vec![target.middle()];
    };
    let farthest_m = 0.5 * target.way_out_m(target.middle(), aside);
    // Slightly more, because the quotient may be an integer.
    let steps = (farthest_m / ASIDE_M + 1e-6).clamp(0.0, 100.0) as usize;
    let each = (1..=steps).flat_map(|n| [n as f64, -(n as f64)]);
    std::iter::once(0.0)
        .chain(each)
        .map(|n| target.middle() + aside * (n * ASIDE_M))
        .collect()
}

/// Returns the box that the needle must avoid for a structure.
fn around(structure: &StructureInfo) -> Box3 {
    Box3::of(
        structure.lower_m.map(|v| v - SPARED_M),
        structure.upper_m.map(|v| v + SPARED_M),
    )
}

/// Returns the request that moves the simulated hand to `tip_m`; m/s and m/s².
pub fn move_request(tip_m: [f64; 3], direction: [f64; 3], speed: f64, acceleration: f64) -> Request {
    Request::MoveHand(HandMove {
        tip_m,
        direction,
        speed_m_per_s: speed,
        acceleration_m_per_s2: acceleration,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn scene(patient_from_scene: [f64; 12]) -> SceneHeader {
        let mut scene = SceneHeader::zeroed();
        (scene.lower_m, scene.upper_m) = ([0.02, 0.02, 0.03], [0.06, 0.06, 0.07]);
        (scene.target_lower_m, scene.target_upper_m) = (scene.lower_m, scene.upper_m);
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
    }

    #[test]
    fn the_needle_goes_superior_in_any_scene_frame() {
        // Superior is -y of the scene.
        let plan = default_plan(&scene([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0]));
        assert!((plan.direction[1] + 1.0).abs() < 1e-12);
        assert!(plan.entry_m[1] > 0.06);
        assert_eq!(default_plan(&scene([0.0; 12])).direction, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn the_needle_starts_outside_the_body_and_seeds_lie_in_the_target() {
        let mut scene = scene(IDENTITY);
        (scene.lower_m, scene.upper_m) = ([0.0; 3], [0.1, 0.1, 0.2]);
        let plan = default_plan(&scene);
        assert!((plan.entry_m[2] + 0.01).abs() < 1e-12);
        assert!((plan.seeds_m[0][2] - 0.062).abs() < 1e-12);
    }

    #[test]
    fn the_needle_avoids_spared_structures() {
        let mut scene = scene(IDENTITY);
        scene.structure_count = 2;
        let urethra = &mut scene.structures[0];
        (urethra.role, urethra.lower_m, urethra.upper_m) = (role::SPARE, [0.037, 0.03, 0.02], [0.043, 0.05, 0.08]);
        // Beyond the deepest seed, so not in the way.
        let bladder = &mut scene.structures[1];
        (bladder.role, bladder.lower_m, bladder.upper_m) = (role::SPARE, [0.02, 0.02, 0.068], [0.06, 0.06, 0.09]);
        let plan = default_plan(&scene);
        // 3 mm and 5 mm from the middle, in steps of 2.5 mm.
        assert!((plan.entry_m[0] - 0.05).abs() < 1e-12, "{:?}", plan.entry_m);
        assert!((plan.seeds_m[4][0] - 0.05).abs() < 1e-12);
        scene.structures[0].role = 0;
        assert!((default_plan(&scene).entry_m[0] - 0.04).abs() < 1e-12);
    }
}
