//! Words over the three-dimensional picture: axes, landmarks, the bar that gives the scale, what each shape means.

use super::camera::Camera;
use super::kinds::{Kind, kinds};
use super::scene3d::Look;
use super::state::ViewState;
use crate::dose_worker::{DoseResult, LEVELS};
use crate::shown::Shown;
use crate::theme::{IMAGE, Tokens};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, Vec2};
use stylet_base::format;

/// Height of a row of the legend, and the share of the picture that all of them may take.
const ROW: f32 = 16.0;
const MOST_SHARE: f32 = 0.5;

pub struct Legend<'a> {
    pub painter: &'a Painter,
    pub rect: Rect,
    pub camera: &'a Camera,
    pub tokens: &'static Tokens,
    pub shown: &'a Shown,
}

impl Legend<'_> {
    fn at(&self, place_m: [f32; 3]) -> Option<Pos2> {
        let aspect = self.rect.width() / self.rect.height().max(1.0);
        let [x, y] = self.camera.project(aspect, place_m)?;
        Some(self.rect.min + Vec2::new(x * self.rect.width(), y * self.rect.height()))
    }

    fn word(&self, place: Pos2, anchor: Align2, text: &str, color: Color32) {
        self.painter
            .text(place, anchor, text, FontId::proportional(12.0), color);
    }

    pub fn landmarks(&self, corner_m: Option<[f32; 3]>, view: &ViewState) {
        if let Some(corner) = corner_m {
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                let mut end = corner;
                end[axis] += 0.0145;
                if let Some(place) = self.at(end) {
                    self.word(place, Align2::CENTER_CENTER, name, self.tokens.weak);
                }
            }
        }
        if let Some(plan) = &self.shown.plan
            && let Some(place) = self.at(plan.entry_m.map(|c| c as f32))
        {
            self.word(
                place - Vec2::new(0.0, 16.0),
                Align2::CENTER_BOTTOM,
                "entry",
                self.tokens.entry,
            );
        }
        if let ([a, b], Some(length_m)) = (view.measure.points_m(), view.measure.length_m()) {
            let middle = (a + b) / 2.0;
            if let Some(place) = self.at([middle.x, middle.y, middle.z].map(|c| c as f32)) {
                let text = format::length(length_m);
                self.word(
                    place - Vec2::new(0.0, 6.0),
                    Align2::CENTER_BOTTOM,
                    &text,
                    self.tokens.measure,
                );
            }
        }
    }

    pub fn scale_bar(&self) {
        let height_m = self.camera.height_at_target_m();
        let points_per_mm = self.rect.height() / (format::mm(f64::from(height_m)) as f32).max(1e-6);
        let length_mm = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0]
            .into_iter()
            .find(|mm| mm * points_per_mm >= 44.0)
            .unwrap_or(500.0_f32);
        let end = self.rect.right_bottom() - Vec2::new(16.0, 12.0);
        let start = end - Vec2::new(length_mm * points_per_mm, 0.0);
        let stroke = Stroke::new(2.0, self.tokens.path);
        self.painter.line_segment([start, end], stroke);
        for place in [start, end] {
            self.painter
                .line_segment([place - Vec2::new(0.0, 4.0), place + Vec2::new(0.0, 4.0)], stroke);
        }
        let middle = start + (end - start) * 0.5 - Vec2::new(0.0, 5.0);
        self.word(
            middle,
            Align2::CENTER_BOTTOM,
            &format!("{length_mm:.0} mm"),
            self.tokens.path,
        );
    }

    /// From below upwards; a filled dot is a surface, a ring a mark that is only planned.
    pub fn rows(&self, look: Look, dose: Option<&DoseResult>) {
        let mut rows: Vec<(String, Color32, bool)> = Vec::new();
        let t = self.tokens;
        if let Some(scene) = &self.shown.scene {
            rows.push(("gland".to_owned(), t.gland, true));
            let others: Vec<Kind> = kinds(Some(scene)).collect();
            for (kind, name) in [
                (Kind::Spared, "to be spared"),
                (Kind::Bone, "bone"),
                (Kind::Body, "body"),
            ] {
                if others.contains(&kind) {
                    rows.push((name.to_owned(), kind.color(t), true));
                }
            }
        }
        if look.rest_shape {
            rows.push(("gland at rest".to_owned(), t.ghost, true));
        }
        if self.shown.plan.is_some() || self.shown.planning.implant.is_some() {
            rows.push(("planned seed".to_owned(), t.seed_planned, false));
        }
        if !self.shown.seeds.is_empty() {
            rows.push(("placed seed".to_owned(), t.seed_placed, true));
        }
        for shell in dose.iter().flat_map(|d| &d.shells).filter(|s| !s.points_m.is_empty()) {
            let text = format!("{:.0} % isodose", LEVELS[shell.level] * 100.0);
            rows.push((text, IMAGE.isodose[shell.level], true));
        }
        // In a small picture it would lie over what it explains.
        if rows.len() as f32 * ROW > MOST_SHARE * self.rect.height() {
            return;
        }
        let mut place = self.rect.left_bottom() + Vec2::new(16.0, -14.0);
        for (name, color, filled) in rows.into_iter().rev() {
            if filled {
                self.painter.circle_filled(place, 4.5, color);
            } else {
                self.painter.circle_stroke(place, 4.0, Stroke::new(1.5, color));
            }
            self.word(place + Vec2::new(11.0, 0.0), Align2::LEFT_CENTER, &name, t.weak);
            place.y -= ROW;
        }
    }
}
