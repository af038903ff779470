//! Limits of the tissue: the paper's limits as settings, validated, and in the form that the loop uses.

use serde::{Deserialize, Serialize};
pub use stylet_settings::folding;

mod validate;

/// Settings as read. Paper eq. 3-5, Table 1.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueParameters {
    /// Shortest link, as a fraction of its rest length.
    pub min_stretch: f64,
    /// Longest link, as a fraction of its rest length.
    pub max_stretch: f64,
    /// Shear angle of links along x, the same both ways (`maxHoriRx`), degrees.
    pub shear_deg: f64,
    /// Shear angle of links along y and z (`maxVertRy`), degrees.
    pub shear_vert_deg: f64,
    /// Time in which the surroundings take 63 % of a displacement back, s; infinite: they do not.
    pub recovery_time_s: f64,
    /// Largest violation of a limit that counts as none, in elements.
    pub residual_tolerance: f64,
}

impl Default for TissueParameters {
    fn default() -> Self {
        TissueParameters {
            min_stretch: 0.55,
            max_stretch: 1.75,
            shear_deg: 26.565,
            shear_vert_deg: 26.565,
            recovery_time_s: 1.0,
            residual_tolerance: 1e-3,
        }
    }
}

/// Settings of links along one axis, for structures that have their own. Paper eq. 3-5.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisLimits {
    /// Shortest link, as a fraction of its rest length.
    pub min_stretch: f64,
    /// Longest link, as a fraction of its rest length.
    pub max_stretch: f64,
    /// Shear angle, degrees.
    pub shear_deg: f64,
}

/// Limits of links along one axis, on the difference of the displacements of their ends, in elements.
///
/// Displacements instead of positions: at rest every difference is zero, wherever the element is, so f32
/// keeps the same precision far from the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkLimits {
    /// Least difference along the link: `min_stretch - 1`.
    pub low: f32,
    /// Largest difference along the link: `max_stretch - 1`.
    pub high: f32,
    /// Tangent of the shear angle: `|d_side| <= tan * (1 + d_along)`, a frustum.
    pub tan: f32,
}

impl LinkLimits {
    pub(crate) fn of(limits: &AxisLimits) -> LinkLimits {
        LinkLimits {
            low: (limits.min_stretch - 1.0) as f32,
            high: (limits.max_stretch - 1.0) as f32,
            tan: limits.shear_deg.to_radians().tan() as f32,
        }
    }

    /// Returns the tighter of each limit.
    pub(crate) fn tighter(&self, other: &LinkLimits) -> LinkLimits {
        LinkLimits {
            low: self.low.max(other.low),
            high: self.high.min(other.high),
            tan: self.tan.min(other.tan),
        }
    }
}

/// Validated settings, as the step uses them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    pub(crate) links: [LinkLimits; 3],
    pub(crate) recovery_time_s: f64,
    pub(crate) tolerance: f32,
}

impl Limits {
    /// Limits of the links along x, y and z.
    pub fn links(&self) -> &[LinkLimits; 3] {
        &self.links
    }
}

impl TissueParameters {
    fn active(&self) -> Limits {
        let (min_stretch, max_stretch) = (self.min_stretch, self.max_stretch);
        let [horizontal, vertical] = [self.shear_deg, self.shear_vert_deg].map(|shear_deg| {
            LinkLimits::of(&AxisLimits {
                min_stretch,
                max_stretch,
                shear_deg,
            })
        });
        Limits {
            links: [horizontal, vertical, vertical],
            recovery_time_s: self.recovery_time_s,
            tolerance: self.residual_tolerance as f32,
        }
    }
}

#[cfg(test)]
mod tests;
