//! The probe as a rigid body: a round shaft with a rounded tip, and how far a point is from it.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Round shaft with a hemispherical end; it reaches back as far as the wall does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeShape {
    /// Radius of the shaft, m.
    pub radius_m: f64,
}

impl Default for ProbeShape {
    /// Returns a probe 20 mm across: assumed (`docs/adr/0021-probe.md`).
    fn default() -> Self {
        ProbeShape { radius_m: 10e-3 }
    }
}

/// Pose of the probe, scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbePose {
    /// The foremost point of its tip, m.
    pub tip_m: [f64; 3],
    /// Unit vector from handle to tip.
    pub axis: [f64; 3],
}

impl ProbePose {
    /// Makes a pose; `None` where a number is not finite or the axis has no length.
    pub fn new(tip_m: [f64; 3], axis: [f64; 3]) -> Option<Self> {
        let axis = Vector3::from(axis).try_normalize(1e-9)?;
        let is_finite = tip_m.iter().chain(axis.iter()).all(|c| c.is_finite());
        is_finite.then_some(ProbePose {
            tip_m,
            axis: axis.into(),
        })
    }

    /// Returns the motion from this pose to another: displacement of the tip, and rotation about it as a vector, m and
    /// rad.
    pub fn motion_to(&self, other: &ProbePose) -> [f64; 6] {
        let moved = Vector3::from(other.tip_m) - Vector3::from(self.tip_m);
        let (from, to) = (Vector3::from(self.axis), Vector3::from(other.axis));
        let sine = from.cross(&to);
        let angle = sine.norm().atan2(from.dot(&to));
        let turned = sine
            .try_normalize(1e-12)
            .map_or(Vector3::zeros(), |about| about * angle);
        [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z]
    }

    /// Returns the pose that part of the way to another.
    pub(super) fn towards(&self, other: &ProbePose, part: f64) -> ProbePose {
        let mix = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| a[c] + part * (b[c] - a[c]));
        ProbePose::new(mix(self.tip_m, other.tip_m), mix(self.axis, other.axis)).unwrap_or(*other)
    }
}

impl ProbeShape {
    /// Returns the distance of a point from the probe's surface, negative inside, m, and the direction away from the
    /// probe there.
    pub fn gap_m(&self, pose: &ProbePose, point_m: [f64; 3]) -> (f64, [f64; 3]) {
        let axis = Vector3::from(pose.axis);
        // The tip is half a ball about a point of the axis, behind which the shaft begins.
        let from_middle = Vector3::from(point_m) - Vector3::from(pose.tip_m) + axis * self.radius_m;
        let from_middle = from_middle - axis * from_middle.dot(&axis).min(0.0);
        let distance_m = from_middle.norm();
        let outward = from_middle.try_normalize(1e-12).unwrap_or_else(|| across(&axis));
        (distance_m - self.radius_m, outward.into())
    }
}

/// Returns some direction across the axis, for a point on it.
fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.y.abs() < 0.9 { Vector3::y() } else { Vector3::x() };
    (other - axis * axis.dot(&other)).try_normalize(1e-9).unwrap_or(other)
}
