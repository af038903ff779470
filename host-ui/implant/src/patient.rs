//! Directions of the patient, and boxes, in the scene.

use nalgebra::Vector3;
use stylet_shm_schema::SceneHeader;

/// Returns an axis of the patient (0 right, 2 superior) in the scene; `otherwise` if the transform
/// is not a rotation.
pub fn patient_axis(scene: &SceneHeader, axis: usize, otherwise: Vector3<f64>) -> Vector3<f64> {
    let mut in_patient = [0.0; 3];
    in_patient[axis] = 1.0;
    Vector3::from(scene.patient().scene_from_patient_direction(in_patient))
        .try_normalize(0.5)
        .filter(|d| d.iter().all(|c| c.is_finite()))
        .unwrap_or(otherwise)
}

/// Box along the axes of the scene.
pub struct Box3 {
    lower: Vector3<f64>,
    upper: Vector3<f64>,
}

impl Box3 {
    pub fn of(lower_m: [f64; 3], upper_m: [f64; 3]) -> Self {
        Self {
            lower: lower_m.into(),
            upper: upper_m.into(),
        }
    }

    pub fn middle(&self) -> Vector3<f64> {
        (self.lower + self.upper) / 2.0
    }

    /// Returns the distance of a line from a place inside to the surface: the nearest pair of faces
    /// ends it.
    pub fn way_out_m(&self, from: Vector3<f64>, direction: Vector3<f64>) -> f64 {
        (0..3)
            .filter(|&a| direction[a].abs() > 1e-9)
            .map(|a| {
                let face = if direction[a] > 0.0 {
                    self.upper[a]
                } else {
                    self.lower[a]
                };
                (face - from[a]) / direction[a]
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns whether the piece of a line between two distances from `through` enters the box.
    pub fn is_met(&self, through: Vector3<f64>, direction: Vector3<f64>, [from_m, to_m]: [f64; 2]) -> bool {
        let (mut enter, mut leave) = (from_m, to_m);
        for a in 0..3 {
            let (lower, upper) = (self.lower[a] - through[a], self.upper[a] - through[a]);
            if direction[a].abs() < 1e-9 {
                if lower > 0.0 || upper < 0.0 {
                    return false;
                }
                continue;
            }
            let (one, other) = (lower / direction[a], upper / direction[a]);
            (enter, leave) = (enter.max(one.min(other)), leave.min(one.max(other)));
        }
        enter <= leave
    }
}
