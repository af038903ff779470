//! Seeds and needles for pictures of the body.

use super::Shown;
use stylet_imaging::Metal;

impl Shown {
    /// Returns all metal as it lies now.
    pub fn metal(&self) -> Metal {
        Metal::of(
            &self.seeds,
            self.body_moved_m,
            &self.left,
            &self.bend,
            self.state.as_ref(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use stylet_shm_schema::SeedPose;

    /// Guards against seeds that stayed at the scene's place of the body while the tissue around
    /// them moved.
    #[test]
    fn seeds_follow_a_body_moved_by_an_exercise() {
        let mut shown = Shown::empty("lab");
        shown.seeds = vec![SeedPose {
            position_m: [0.01, 0.02, 0.03],
            axis: [0.0, 0.0, 1.0],
            ..bytemuck::Zeroable::zeroed()
        }];
        shown.body_moved_m = [4e-3, 0.0, -1e-3];
        let middle_m = shown.metal().seeds[0].middle_m;
        assert!(
            (middle_m - Vector3::new(0.014, 0.02, 0.029)).norm() < 1e-12,
            "{middle_m}"
        );
    }
}
