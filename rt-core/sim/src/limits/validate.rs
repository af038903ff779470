//! Validation of the tissue's settings.

use super::{Limits, TissueParameters, folding};
use crate::settings::{Problem, Problems};
use stylet_settings::ParameterId;

impl TissueParameters {
    /// Returns the limits as the loop uses them.
    ///
    /// # Errors
    ///
    /// Every setting that cannot be used. A value that is not a number is out of every range.
    pub fn validate(&self) -> Result<Limits, Vec<Problem>> {
        let mut problems = Problems::default();
        self.check_links(&mut problems);
        let tau = self.recovery_time_s;
        problems.unless(
            tau > 0.0,
            "recovery_time_s",
            tau,
            "above 0",
            "large values recover slowly, infinite not at all",
        );
        let tolerance = ParameterId::ResidualTolerance.spec();
        problems.unless(
            tolerance.allows(self.residual_tolerance),
            "residual_tolerance",
            self.residual_tolerance,
            &format!("from {} to {} elements", tolerance.min, tolerance.max),
            "less is below what f32 can resolve",
        );
        self.check_relaxation(&mut problems);
        problems.finish().map(|()| self.active())
    }

    fn check_links(&self, problems: &mut Problems) {
        let (min, max) = (self.min_stretch, self.max_stretch);
        problems.unless(
            min > 0.0 && min <= 1.0,
            "min_stretch",
            min,
            "above 0 and at most 1",
            "1 forbids compression",
        );
        problems.unless(
            (1.0..=100.0).contains(&max),
            "max_stretch",
            max,
            "from 1 to 100",
            "1 forbids extension",
        );
        let is_angle = |angle: &f64| (0.0..90.0).contains(angle);
        for (key, angle) in [("shear_deg", self.shear_deg), ("shear_vert_deg", self.shear_vert_deg)] {
            let advice = "0 forbids shear; the paper has 26.565";
            problems.unless(is_angle(&angle), key, angle, "from 0 to below 90", advice);
        }
        let angles = [self.shear_deg, self.shear_vert_deg, self.shear_vert_deg];
        // Eq. 1 in three dimensions; angles out of range are reported above.
        if angles.iter().all(is_angle) {
            problems.unless(
                folding(angles) <= 1.0,
                "shear_deg, shear_vert_deg",
                folding(angles),
                "at most 1 (eq. 1 in three dimensions: tx ty + ty tz + tz tx + 2 tx ty tz <= 1)",
                "lower an angle, or cells fold over",
            );
        }
    }

    fn check_relaxation(&self, problems: &mut Problems) {
        let iterations = f64::from(self.relaxation_iterations);
        problems.unless(
            iterations <= 1000.0,
            "relaxation_iterations",
            iterations,
            "at most 1000",
            "each is a pass over the whole body in every tick",
        );
        let weight = self.relaxation_weight;
        problems.unless(
            weight > 0.0 && weight < 2.0,
            "relaxation_weight",
            weight,
            "above 0 and below 2",
            "from 2 on the body would swing up instead of coming to rest",
        );
        let along = "stiffness along a link is 1";
        let (shear, foundation) = (self.shear_to_axial, self.foundation_to_axial);
        let (of_shear, of_foundation) = ("from 0.001 to 1000", "from 0 to 1000");
        problems.unless(
            (1e-3..=1000.0).contains(&shear),
            "shear_to_axial",
            shear,
            of_shear,
            along,
        );
        problems.unless(
            (0.0..=1000.0).contains(&foundation),
            "foundation_to_axial",
            foundation,
            of_foundation,
            along,
        );
    }
}
