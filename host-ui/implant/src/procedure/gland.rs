//! Displacement of the target and of any tissue by each needle.

use crate::plan::Anatomy;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use stylet_host::link::{SceneModel, Snapshot};
use stylet_surfaces::field::Field;

/// Number of points of the target, evenly distributed.
const POINTS: f64 = 500.0;

/// Largest displacement, and the place of the tip at that time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Largest {
    /// Size, m.
    pub size_m: f64,
    /// Place of the tip, scene frame, m.
    pub tip_m: [f64; 3],
}

impl Largest {
    fn take(&mut self, size_m: f64, tip_m: [f64; 3]) {
        if size_m > self.size_m {
            *self = Self { size_m, tip_m };
        }
    }
}

/// Effect of one needle.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleMotion {
    /// Mean displacement of the target, relative to its state before the needle.
    pub target: Largest,
    /// Displacement of any tissue from rest: the skin under a tip before it gives way, and tissue
    /// that sticks to the shaft.
    pub tissue: Largest,
    before_m: Vector3<f64>,
}

/// Accumulator of the motion by every needle of a procedure, snapshot by snapshot.
pub struct TargetMotion {
    points_m: Vec<Vector3<f64>>,
    needles: BTreeMap<usize, NeedleMotion>,
    last_tick: Option<u64>,
}

impl TargetMotion {
    /// Creates an accumulator of the scene's target; without one no needle has a motion.
    pub fn of(scene: &SceneModel) -> Self {
        let target = Anatomy::of(scene).ok().map(|anatomy| anatomy.target);
        let points_m = target.map_or_else(Vec::new, |target| {
            let (low_m, high_m) = target.bounds_m();
            let sides_m = [0, 1, 2].map(|a| high_m[a] - low_m[a]);
            let pitch_m = (sides_m.iter().product::<f64>() / POINTS).cbrt();
            let counts = sides_m.map(|side_m| (side_m / pitch_m).ceil() as usize);
            let point_m = |n: usize| {
                let at = [n % counts[0], n / counts[0] % counts[1], n / counts[0] / counts[1]];
                [0, 1, 2].map(|a| low_m[a] + (at[a] as f64 + 0.5) * sides_m[a] / counts[a] as f64)
            };
            let all = (0..counts.iter().product()).map(point_m);
            all.filter(|&place_m| target.contains(place_m))
                .map(Vector3::from)
                .collect()
        });
        Self {
            points_m,
            needles: BTreeMap::new(),
            last_tick: None,
        }
    }

    /// Takes a snapshot while that needle, counted from 0, is in use.
    pub fn take(&mut self, needle: usize, scene: &SceneModel, snapshot: &Snapshot) {
        let header = &snapshot.header;
        if self.points_m.is_empty() || self.last_tick == Some(header.tissue_tick) {
            return;
        }
        self.last_tick = Some(header.tissue_tick);
        let Some(field) = Field::of(scene.header.nodes, &snapshot.displacements_m) else {
            return;
        };
        let sum = self
            .points_m
            .iter()
            .fold(Vector3::zeros(), |sum, place_m| sum + field.displacement_m(*place_m));
        let mean_m = sum / self.points_m.len() as f64;
        self.note(needle, mean_m, header.max_displacement_m, header.tip_in_scene_m);
    }

    fn note(&mut self, needle: usize, target_m: Vector3<f64>, tissue_m: f64, tip_m: [f64; 3]) {
        let motion = self.needles.entry(needle).or_insert_with(|| NeedleMotion {
            target: Largest::default(),
            tissue: Largest::default(),
            before_m: target_m,
        });
        motion.target.take((target_m - motion.before_m).norm(), tip_m);
        motion.tissue.take(tissue_m, tip_m);
    }

    /// Returns the motion by that needle; `None` if it was never observed.
    pub fn of_needle(&self, needle: usize) -> Option<&NeedleMotion> {
        self.needles.get(&needle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_of_each_needle_is_relative_to_the_state_before_it() {
        let mut motion = TargetMotion {
            points_m: Vec::new(),
            needles: BTreeMap::new(),
            last_tick: None,
        };
        let along = |z: f64| Vector3::new(0.0, 0.0, z);
        // The second finds the target 1 mm from its place: needles that stay in hold it there.
        for (needle, target_m, tissue_m, tip_m) in [
            (0, 0.0, 0.0, 0.0),
            (0, 3e-3, 11e-3, 0.02),
            (0, 4e-3, 9e-3, 0.06),
            (0, -1e-3, 2e-3, 0.05),
            (1, 1e-3, 1e-3, 0.0),
            (1, -2e-3, 5e-3, 0.07),
        ] {
            motion.note(needle, along(target_m), tissue_m, [0.0, 0.0, tip_m]);
        }
        let of = |needle| {
            motion
                .of_needle(needle)
                .map(|m| [m.target, m.tissue].map(|l| (l.size_m, l.tip_m[2])))
        };
        assert_eq!(of(0), Some([(4e-3, 0.06), (11e-3, 0.02)]));
        assert_eq!(of(1), Some([(3e-3, 0.07), (5e-3, 0.07)]));
        assert_eq!(of(2), None);
    }
}
