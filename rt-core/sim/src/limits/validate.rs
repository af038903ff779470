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
}
