//! Foundation of a body, face by face.

use super::*;
use crate::scene::Surroundings;
use stylet_anatomy::Beyond;

const H: f64 = 1e-3;

fn resting_on(surroundings: Surroundings) -> FemModel<f64> {
    let settings = FemSettings {
        surroundings: vec![surroundings],
        ..FemSettings::homogeneous(material(0.45, MEAN), 1e6)
    };
    FemModel::new(&block([4, 5, 6], H), &settings).expect("valid")
}

/// Springs add up to the stiffness of the surface that rests on fat; nodes of a fixed face do not move.
#[test]
fn springs_stand_for_the_faces_on_fat_alone() {
    let cells = [5 * 6, 5 * 6, 4 * 6, 4 * 6, 4 * 5, 4 * 5];
    for face in 0..6 {
        for beyond in [Beyond::Free, Beyond::Fixed] {
            let mut surroundings = Surroundings::FAT;
            surroundings.0[face] = beyond;
            let model = resting_on(surroundings);
            let on_fat: usize = (0..6).filter(|&f| f != face).map(|f| cells[f]).sum();
            let wanted = 1e6 * on_fat as f64 * H * H;
            let sum: f64 = model.levels[0].springs.iter().sum();
            assert!(
                (sum / wanted - 1.0).abs() < 1e-12,
                "{sum} N/m, {wanted} N/m of {surroundings:?}"
            );
            let free = model.levels[0].inverse_diagonal.iter().filter(|&&d| d != 0.0).count();
            let nodes = [6 * 7, 6 * 7, 5 * 7, 5 * 7, 5 * 6, 5 * 6];
            let fixed = if beyond == Beyond::Fixed { nodes[face] } else { 0 };
            assert_eq!(free, 5 * 6 * 7 - fixed, "{surroundings:?}");
        }
    }
}

/// Nothing keeps a body in place that is free on all sides.
#[test]
fn a_body_free_on_all_sides_is_loose() {
    assert_eq!(resting_on(Surroundings::all(Beyond::Free)).loose.len(), 1);
    assert!(resting_on(Surroundings::FAT).loose.is_empty());
}
