//! Instructor-injected faults, to see how a trainee reacts.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use strum::EnumDiscriminants;

/// Range of the stiffness factor of an exercise.
pub const EXERCISE_STIFFNESS_RANGE: [f64; 2] = [1.0, 5.0];
/// Largest displacement of the body by an exercise, m.
pub const MOST_MOVED_M: f64 = 0.01;

/// One fault. The numbers are stable: requests and events carry them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, EnumDiscriminants)]
#[strum_discriminants(name(ExerciseNumber), vis(pub(crate)))]
#[repr(u32)]
pub enum Exercise {
    /// The device counts as disconnected: the force goes off as at a real loss.
    DeviceLost = 1,
    /// Young's modulus of all tissue is multiplied by this factor, for needles that go in from now on.
    StiffTissue {
        /// Within [`EXERCISE_STIFFNESS_RANGE`].
        factor: f64,
    } = 2,
    /// The patient has moved against the template.
    BodyMoved {
        /// Displacement of the body from its place when the scene was loaded, scene frame, m; at most [`MOST_MOVED_M`]
        /// long.
        by_m: [f64; 3],
    } = 3,
}

impl Exercise {
    /// Number in requests and events.
    pub fn number(self) -> u32 {
        ExerciseNumber::from(self) as u32
    }

    /// Factor or distance, by kind.
    pub fn value(self) -> f64 {
        match self {
            Self::DeviceLost => 0.0,
            Self::StiffTissue { factor } => factor,
            Self::BodyMoved { by_m } => length(by_m),
        }
    }
}

/// Text shown to an operator.
impl std::fmt::Display for Exercise {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::DeviceLost => write!(f, "device lost"),
            Self::StiffTissue { factor } => write!(f, "tissue {factor:.1} times as stiff"),
            Self::BodyMoved { by_m } => {
                let [x, y, z] = by_m.map(|m| m * 1e3);
                let size_mm = length(by_m) * 1e3;
                write!(f, "gland moved by {size_mm:.1} mm (x {x:+.1}, y {y:+.1}, z {z:+.1})")
            }
        }
    }
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Faults in force; all zero for none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ExercisesInForce {
    /// 1 while the device counts as lost.
    pub device_lost: u32,
    /// Zero.
    pub reserved: u32,
    /// Factor on Young's modulus; 0 for none.
    pub stiffness: f64,
    /// Displacement or target displacement of the body from its original place, scene frame, m.
    pub body_moved_m: [f64; 3],
}

impl ExercisesInForce {
    /// Adds a fault, or changes its value.
    pub fn put(&mut self, exercise: Exercise) {
        match exercise {
            Exercise::DeviceLost => self.device_lost = 1,
            Exercise::StiffTissue { factor } => self.stiffness = factor,
            Exercise::BodyMoved { by_m } => self.body_moved_m = by_m,
        }
    }

    /// Returns the faults in force, in the order of their numbers.
    pub fn all(&self) -> impl Iterator<Item = Exercise> {
        let lost = (self.device_lost != 0).then_some(Exercise::DeviceLost);
        let factor = self.stiffness;
        let stiff = (factor != 0.0).then_some(Exercise::StiffTissue { factor });
        let by_m = self.body_moved_m;
        let moved = (by_m != [0.0; 3]).then_some(Exercise::BodyMoved { by_m });
        [lost, stiff, moved].into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_exercise_in_force_is_named_once_in_the_order_of_the_numbers() {
        let mut in_force = ExercisesInForce::zeroed();
        assert_eq!(in_force.all().count(), 0);
        for exercise in [
            Exercise::BodyMoved {
                by_m: [0.003, 0.0, -0.004],
            },
            Exercise::StiffTissue { factor: 2.0 },
            Exercise::DeviceLost,
            Exercise::StiffTissue { factor: 3.0 },
        ] {
            in_force.put(exercise);
        }
        let words: Vec<String> = in_force.all().map(|e| e.to_string()).collect();
        let moved = "gland moved by 5.0 mm (x +3.0, y +0.0, z -4.0)";
        assert_eq!(words, ["device lost", "tissue 3.0 times as stiff", moved]);
        assert_eq!(in_force.all().map(Exercise::number).collect::<Vec<_>>(), [1, 2, 3]);
    }
}
