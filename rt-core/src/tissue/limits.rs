//! What the tissue may do: the paper's limits as settings, checked, and as the loop uses them.

use std::fmt;

/// Settings as read. Paper eq. 3-5, Table 1.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueParameters {
    /// Shortest link, as a fraction of its rest length.
    pub min_stretch: f64,
    /// Longest link, as a fraction of its rest length.
    pub max_stretch: f64,
    /// Shear angle of links along x, the same both ways (`maxHoriRx`).
    pub shear_deg: f64,
    /// Shear angle of links along y and z (`maxVertRy`).
    pub shear_vert_deg: f64,
    /// Time in which the surroundings take 63 % of a displacement back.
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

/// Settings of links along one axis, for structures that have their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    pub min_stretch: f64,
    pub max_stretch: f64,
    pub shear_deg: f64,
}

/// Limits of links along one axis, on the difference of the displacements of their ends, in elements.
///
/// Displacements instead of positions: at rest every difference is zero, wherever the element is, so f32
/// keeps the same precision far from the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LinkLimits {
    /// `min_stretch - 1`
    pub low: f32,
    /// `max_stretch - 1`
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

    /// Of each limit the tighter one.
    pub(crate) fn tighter(&self, other: &LinkLimits) -> LinkLimits {
        LinkLimits {
            low: self.low.max(other.low),
            high: self.high.min(other.high),
            tan: self.tan.min(other.tan),
        }
    }
}

/// Checked settings, as the step uses them.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    pub(crate) links: [LinkLimits; 3],
    pub(crate) recovery_time_s: f64,
    pub(crate) tolerance: f32,
}

/// A setting that is out of its range.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterProblem {
    pub name: &'static str,
    pub value: f64,
    pub limit: &'static str,
    pub advice: &'static str,
}

impl fmt::Display for ParameterProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            value,
            limit,
            advice,
        } = self;
        write!(f, "{name} is {value}, must be {limit}: {advice}")
    }
}

impl std::error::Error for ParameterProblem {}

impl TissueParameters {
    /// Lists every problem. A value that is not a number is out of every range.
    pub fn validate(&self) -> Result<Limits, Vec<ParameterProblem>> {
        let mut problems = Vec::new();
        let mut check = |ok: bool, name, value, limit, advice| {
            if !ok {
                problems.push(ParameterProblem {
                    name,
                    value,
                    limit,
                    advice,
                });
            }
        };
        let min = self.min_stretch;
        check(
            min > 0.0 && min <= 1.0,
            "min_stretch",
            min,
            "above 0 and at most 1",
            "1 forbids compression",
        );
        let max = self.max_stretch;
        check(
            (1.0..=100.0).contains(&max),
            "max_stretch",
            max,
            "from 1 to 100",
            "1 forbids extension",
        );
        let (shear, vert) = (self.shear_deg, self.shear_vert_deg);
        for (name, angle) in [("shear_deg", shear), ("shear_vert_deg", vert)] {
            let advice = "0 forbids shear; the paper has 26.565";
            check((0.0..90.0).contains(&angle), name, angle, "from 0 to below 90", advice);
        }
        check(
            shear + vert < 90.0,
            "shear_deg + shear_vert_deg",
            shear + vert,
            "below 90 (eq. 1)",
            "lower one of them, or cells fold over",
        );
        let tau = self.recovery_time_s;
        check(
            tau > 0.0 && tau.is_finite(),
            "recovery_time_s",
            tau,
            "above 0 and finite",
            "large values recover slowly",
        );
        let tolerance = self.residual_tolerance;
        check(
            (1e-4..=0.1).contains(&tolerance),
            "residual_tolerance",
            tolerance,
            "from 0.0001 to 0.1 elements",
            "less is below what f32 can resolve",
        );
        if problems.is_empty() {
            Ok(self.active())
        } else {
            Err(problems)
        }
    }

    fn active(&self) -> Limits {
        let links = |shear_deg: f64| LinkLimits {
            low: (self.min_stretch - 1.0) as f32,
            high: (self.max_stretch - 1.0) as f32,
            tan: shear_deg.to_radians().tan() as f32,
        };
        let (horizontal, vertical) = (links(self.shear_deg), links(self.shear_vert_deg));
        Limits {
            links: [horizontal, vertical, vertical],
            recovery_time_s: self.recovery_time_s,
            tolerance: self.residual_tolerance as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_settings_are_valid() {
        assert!(TissueParameters::default().validate().is_ok());
    }

    #[test]
    fn every_problem_is_listed_at_once() {
        let parameters = TissueParameters {
            min_stretch: f64::NAN,
            max_stretch: 0.5,
            shear_deg: 45.0,
            shear_vert_deg: 45.0,
            recovery_time_s: 0.0,
            residual_tolerance: f64::INFINITY,
        };
        let problems = parameters.validate().expect_err("five problems");
        let names: Vec<_> = problems.iter().map(|problem| problem.name).collect();
        let expected = [
            "min_stretch",
            "max_stretch",
            "shear_deg + shear_vert_deg",
            "recovery_time_s",
            "residual_tolerance",
        ];
        assert_eq!(names, expected);
        assert_eq!(
            problems[1].to_string(),
            "max_stretch is 0.5, must be from 1 to 100: 1 forbids extension"
        );
    }

    #[test]
    fn equation_1_refuses_ninety_degrees_and_accepts_just_below() {
        let with = |shear_deg| TissueParameters {
            shear_deg,
            shear_vert_deg: 30.0,
            ..TissueParameters::default()
        };
        assert!(with(60.0).validate().is_err());
        assert!(with(59.999).validate().is_ok());
    }
}
