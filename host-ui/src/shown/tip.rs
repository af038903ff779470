//! The tip of the needle by the body: in contact, outside, or inside without contact.

use super::Shown;
use nalgebra::Vector3;
use stylet_host::link::{Link, SceneModel};
use stylet_procedure::tolerance::OUTSIDE_M;
use stylet_shm_schema::flags;

impl Shown {
    pub fn tip_m(&self) -> Option<[f64; 3]> {
        self.state.filter(|s| s.tick > 0).map(|s| s.tip_in_scene_m)
    }

    /// Returns whether the tip touches tissue, or is behind a membrane.
    pub fn is_in_tissue(&self) -> bool {
        self.has_punctured() || self.has_flag(flags::IN_CONTACT)
    }

    pub(super) fn take_tip(&mut self, link: &Link) {
        let is_inside = link.scene().is_some_and(|scene| self.is_tip_inside(scene));
        self.is_free_inside = is_inside && !self.is_in_tissue() && !self.has_flag(flags::HAND_EMPTY);
    }

    /// Returns whether the tip is in the body at rest, farther than contact needs to begin.
    fn is_tip_inside(&self, scene: &SceneModel) -> bool {
        let (Some(tip_m), Some(state)) = (self.tip_m(), &self.state) else {
            return false;
        };
        let back = Vector3::from(state.needle_direction) * OUTSIDE_M;
        let is_body = |place_m: Vector3<f64>| scene.label_at(place_m.into()) != 0;
        is_body(tip_m.into()) && is_body(Vector3::from(tip_m) - back)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_shm_schema::{HapticState, SceneHeader};

    #[test]
    fn a_tip_in_the_body_is_told_from_one_at_its_surface() {
        let mut header = SceneHeader::zeroed();
        (header.labels.dims, header.labels.spacing_m) = ([1, 1, 20], 1e-3);
        // Body from 10 mm on.
        let labels = (0..20).map(|z| u8::from(z >= 10)).collect();
        let scene = SceneModel::new(header, Vec::new(), Vec::new(), labels);
        let mut shown = Shown::empty("lab");
        for (depth_m, is_inside) in [(5e-3, false), (11e-3, false), (14e-3, true), (30e-3, false)] {
            let mut state = HapticState::zeroed();
            (state.tick, state.needle_direction) = (1, [0.0, 0.0, 1.0]);
            state.tip_in_scene_m = [0.0, 0.0, depth_m];
            shown.state = Some(state);
            assert_eq!(shown.is_tip_inside(&scene), is_inside, "{depth_m} m");
        }
    }
}
