//! What the tissue may do: the paper's limits as settings, checked, and as the loop uses them.

use serde::{Deserialize, Serialize};
use std::fmt;
use stylet_shm_schema::ParameterId;
pub use stylet_shm_schema::folding;

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
    /// Time in which the surroundings take 63 % of a displacement back; infinite: they do not.
    pub recovery_time_s: f64,
    /// Largest violation of a limit that counts as none, in elements.
    pub residual_tolerance: f64,
    /// Passes of elastic relaxation after each propagation; 0 for none, at no cost.
    pub relaxation_iterations: u32,
    /// How much of the way a pass of relaxation takes: 1 for all, up to below 2 to go beyond, which converges faster.
    pub relaxation_weight: f64,
    /// Stiffness of a link across over that along it.
    pub shear_to_axial: f64,
    /// Stiffness of the surroundings for each element, over that along a link.
    pub ground_stiffness: f64,
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
            relaxation_iterations: 0,
            relaxation_weight: 1.6,
            shear_to_axial: 0.25,
            ground_stiffness: 0.01,
        }
    }
}

/// Settings of links along one axis, for structures that have their own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisLimits {
    pub min_stretch: f64,
    pub max_stretch: f64,
    pub shear_deg: f64,
}

/// Limits of links along one axis, on the difference of the displacements of their ends, in elements.
///
/// Displacements instead of positions: at rest every difference is zero, wherever the element is, so f32
/// keeps the same precision far from the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    pub(crate) links: [LinkLimits; 3],
    pub(crate) recovery_time_s: f64,
    pub(crate) tolerance: f32,
    pub(crate) relaxation: Option<Relaxation>,
}

/// Elastic relaxation; stiffnesses beside that along a link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Relaxation {
    pub iterations: u32,
    pub weight: f32,
    pub shear: f32,
    pub ground: f32,
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
        let mut problems = Problems::default();
        problems.of_stretch(self.min_stretch, self.max_stretch);
        let (shear, vert) = (self.shear_deg, self.shear_vert_deg);
        problems.of_angle("shear_deg", shear);
        problems.of_angle("shear_vert_deg", vert);
        problems.of_folding("shear_deg, shear_vert_deg", [shear, vert, vert]);
        let tau = self.recovery_time_s;
        problems.check(
            tau > 0.0,
            "recovery_time_s",
            tau,
            "above 0",
            "large values recover slowly, infinite not at all",
        );
        problems.check(
            ParameterId::ResidualTolerance.spec().allows(self.residual_tolerance),
            "residual_tolerance",
            self.residual_tolerance,
            "from 0.0001 to 0.01 elements",
            "less is below what f32 can resolve",
        );
        self.check_relaxation(&mut problems);
        if problems.0.is_empty() {
            Ok(self.active())
        } else {
            Err(problems.0)
        }
    }

    fn check_relaxation(&self, problems: &mut Problems) {
        let iterations = f64::from(self.relaxation_iterations);
        problems.check(
            iterations <= 1000.0,
            "relaxation_iterations",
            iterations,
            "at most 1000",
            "each is a pass over the whole body in every tick",
        );
        let weight = self.relaxation_weight;
        problems.check(
            weight > 0.0 && weight < 2.0,
            "relaxation_weight",
            weight,
            "above 0 and below 2",
            "from 2 on the body would swing up instead of coming to rest",
        );
        for (name, value, from) in [
            ("shear_to_axial", self.shear_to_axial, 1e-3),
            ("ground_stiffness", self.ground_stiffness, 0.0),
        ] {
            let advice = "stiffness along a link is 1";
            let limit = if from > 0.0 {
                "from 0.001 to 1000"
            } else {
                "from 0 to 1000"
            };
            problems.check((from..=1000.0).contains(&value), name, value, limit, advice);
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
            relaxation: (self.relaxation_iterations > 0).then_some(Relaxation {
                iterations: self.relaxation_iterations,
                weight: self.relaxation_weight as f32,
                shear: self.shear_to_axial as f32,
                ground: self.ground_stiffness as f32,
            }),
        }
    }
}

#[derive(Default)]
struct Problems(Vec<ParameterProblem>);

impl Problems {
    fn check(&mut self, ok: bool, name: &'static str, value: f64, limit: &'static str, advice: &'static str) {
        if !ok {
            self.0.push(ParameterProblem {
                name,
                value,
                limit,
                advice,
            });
        }
    }

    fn of_stretch(&mut self, min: f64, max: f64) {
        self.check(
            min > 0.0 && min <= 1.0,
            "min_stretch",
            min,
            "above 0 and at most 1",
            "1 forbids compression",
        );
        self.check(
            (1.0..=100.0).contains(&max),
            "max_stretch",
            max,
            "from 1 to 100",
            "1 forbids extension",
        );
    }

    fn of_angle(&mut self, name: &'static str, angle: f64) {
        let advice = "0 forbids shear; the paper has 26.565";
        self.check((0.0..90.0).contains(&angle), name, angle, "from 0 to below 90", advice);
    }

    /// Eq. 1 in three dimensions; angles that are out of range have been told already.
    fn of_folding(&mut self, name: &'static str, shear_deg: [f64; 3]) {
        if shear_deg.iter().all(|angle| (0.0..90.0).contains(angle)) {
            let value = folding(shear_deg);
            self.check(
                value <= 1.0,
                name,
                value,
                "at most 1 (eq. 1 in three dimensions: tx ty + ty tz + tz tx + 2 tx ty tz <= 1)",
                "lower an angle, or cells fold over",
            );
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
            relaxation_iterations: 1001,
            relaxation_weight: 2.0,
            shear_to_axial: 0.0,
            ground_stiffness: f64::NAN,
        };
        let problems = parameters.validate().expect_err("nine problems");
        let names: Vec<_> = problems.iter().map(|problem| problem.name).collect();
        let expected = [
            "min_stretch",
            "max_stretch",
            "shear_deg, shear_vert_deg",
            "recovery_time_s",
            "residual_tolerance",
            "relaxation_iterations",
            "relaxation_weight",
            "shear_to_axial",
            "ground_stiffness",
        ];
        assert_eq!(names, expected);
        assert_eq!(
            problems[1].to_string(),
            "max_stretch is 0.5, must be from 1 to 100: 1 forbids extension"
        );
    }

    #[test]
    fn equation_1_in_three_dimensions_is_the_sign_of_the_smallest_corner() {
        // Oracle: the least determinant over all signs of all six shears.
        let mut random = crate::scene::test_bodies::Random(5);
        for _ in 0..2000 {
            let angles = [(); 3].map(|()| 60.0 * random.unit());
            let t = angles.map(|angle: f64| angle.to_radians().tan());
            let least = (0..64).map(|signs| {
                let a = |n: usize, axis: usize| if signs >> n & 1 == 0 { t[axis] } else { -t[axis] };
                let m = nalgebra::Matrix3::new(1.0, a(0, 0), a(1, 0), a(2, 1), 1.0, a(3, 1), a(4, 2), a(5, 2), 1.0);
                m.determinant()
            });
            let least = least.fold(f64::INFINITY, f64::min);
            assert!(
                (least - (1.0 - folding(angles))).abs() < 1e-9 * (1.0 + least.abs()),
                "{angles:?}"
            );
        }
    }

    #[test]
    fn angles_at_the_edge_of_folding_are_accepted_and_those_beyond_refused() {
        let with = |shear_deg, shear_vert_deg| TissueParameters {
            shear_deg,
            shear_vert_deg,
            ..TissueParameters::default()
        };
        for (shear, vert, ok) in [
            (26.565, 26.565, true),
            (26.566, 26.566, false),
            (0.0, 44.999, true),
            (0.0, 45.001, false),
            // Eq. 1 in a plane allows this one.
            (30.0, 59.99, false),
            (60.0, 12.0, true),
            (60.0, 13.0, false),
        ] {
            let result = with(shear, vert).validate();
            assert_eq!(result.is_ok(), ok, "{shear}, {vert}");
            if let Err(problems) = result {
                assert!(problems[0].to_string().contains("eq. 1 in three dimensions"));
            }
        }
    }
}
