//! The needle's places in a frame, and the age of the tissue's answer.

use super::Shown;

impl Shown {
    /// Returns places along the needle from the tip to `length_m` behind it, scene frame; two if it
    /// does not bend.
    pub fn needle_points_m(&self, length_m: f64) -> Option<Vec<[f64; 3]>> {
        let state = self.state.filter(|s| s.tick > 0)?;
        Some(
            self.bend
                .points_m(state.tip_in_scene_m, state.needle_direction, length_m),
        )
    }

    /// Returns age (s) and travel of the tip (m) since the tissue's last answer, for a needle in
    /// tissue without a line.
    pub fn lag(&self) -> Option<(f64, f64)> {
        let state = self.state.filter(|s| s.lag_ns > 0)?;
        Some((state.lag_ns as f64 * 1e-9, state.lag_m))
    }
}
