//! A patch in a corner of the window that changes when the tip moves, for a photodiode: from motion
//! to photon.

use egui::{Color32, Context, Id, LayerId, Order, Rect, Vec2};
use nalgebra::{Point3, distance};

/// Side of the square; a photodiode with its holder covers it.
const SIDE: f32 = 64.0;
/// Distance between two changes of the patch: more than the tremor of a hand at rest.
const STEP_M: f64 = 0.5e-3;

/// Brightness, and tip position at its last change.
#[derive(Debug, Default)]
pub(super) struct Patch {
    is_light: bool,
    changed_at_m: Option<Point3<f64>>,
}

impl Patch {
    /// Takes the tip of the frame, `None` without a core; returns true while the patch is light.
    pub(super) fn take(&mut self, tip_in_scene_m: Option<[f64; 3]>) -> bool {
        if let Some(tip) = tip_in_scene_m.map(Point3::from) {
            match self.changed_at_m {
                None => self.changed_at_m = Some(tip),
                Some(before) if distance(&before, &tip) >= STEP_M => {
                    self.is_light = !self.is_light;
                    self.changed_at_m = Some(tip);
                }
                Some(_) => {}
            }
        }
        self.is_light
    }
}

/// Draws the patch over everything else, in the lower right corner, away from all buttons.
pub(super) fn patch_ui(ctx: &Context, is_light: bool) {
    let window = ctx.content_rect();
    let corner = window.max - Vec2::splat(SIDE);
    let colour = if is_light { Color32::WHITE } else { Color32::BLACK };
    let painter = ctx.layer_painter(LayerId::new(Order::Tooltip, Id::unique("patch")));
    painter.rect_filled(Rect::from_min_size(corner, Vec2::splat(SIDE)), 0.0, colour);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patch_changes_once_for_each_step_of_the_tip_and_never_at_rest() {
        let mut patch = Patch::default();
        let at = |z_mm: f64| Some([0.01, -0.02, z_mm * 1e-3]);
        assert!(!patch.take(None) && !patch.take(at(0.0)));
        for tremble in [0.2, -0.3, 0.4, -0.4, 0.0] {
            assert!(!patch.take(at(tremble)), "{tremble} mm");
        }
        let seen: Vec<bool> = [0.6, 0.7, 1.0, 1.2, 5.0, 5.0].map(|z_mm| patch.take(at(z_mm))).to_vec();
        assert_eq!(seen, [true, true, true, false, true, true]);
        // Without a core the patch keeps its colour.
        assert!(patch.take(None));
    }
}
