//! Where the hands begin, outside the body.

use nalgebra::Vector3;
use stylet_anatomy::Organ;
use stylet_sim::scene::Scene;

/// Distance outside the body at which a hand begins, m.
const BEFORE_BODY_M: f64 = 0.03;

/// Start of the hand with the needle: outside the body and below the target.
pub fn needle_start(scene: &Scene) -> Vector3<f64> {
    let (lower, upper) = scene.target_bounds_m();
    Vector3::new(
        (lower[0] + upper[0]) / 2.0,
        (lower[1] + upper[1]) / 2.0,
        before_body(scene),
    )
}

/// Start of the other hand: outside the body and below the rectum; in a scene without one, behind the target.
pub fn second_start(scene: &Scene) -> Vector3<f64> {
    let is_rectum = |name: &str| matches!(Organ::of_name(name), Some(Organ::Rectum | Organ::RectalWall));
    let extents = scene.lattice.extents(scene.structures.len());
    let rectum = scene.structures.iter().zip(&extents).find(|(s, _)| is_rectum(&s.name));
    let z = before_body(scene);
    if let Some((_, extent)) = rectum {
        let middle = |axis: usize| (extent.lower_m[axis] + extent.upper_m[axis]) / 2.0;
        return Vector3::new(middle(0), middle(1), z);
    }
    let (lower, upper) = scene.target_bounds_m();
    Vector3::new((lower[0] + upper[0]) / 2.0, lower[1] - BEFORE_BODY_M, z)
}

fn before_body(scene: &Scene) -> f64 {
    let (lowest, _) = scene.lattice.bounds_m();
    lowest[2] - BEFORE_BODY_M
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_hand_begins_below_the_rectum_or_behind_the_target() {
        for name in ["paper", "pelvis"] {
            let scene = Scene::builtin(name).expect("built in");
            let (needle, other) = (needle_start(&scene), second_start(&scene));
            assert!(
                other.y < needle.y - 0.02 && other.z == needle.z,
                "{name}: {needle} {other}"
            );
        }
    }
}
