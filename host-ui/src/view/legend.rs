//! Text over the three-dimensional picture: axes, landmarks, the scale bar, and the legend.

use super::camera::Camera;
use super::kinds::named;
use super::scene3d::Look;
use super::state::ViewState;
use crate::dose_worker::{DoseResult, LEVELS};
use crate::shown::Shown;
use crate::theme::{IMAGE, Tokens};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, Vec2};
use stylet_base::format;

/// Height of a row of the legend, and the share of the picture that all rows may take.
const ROW: f32 = 16.0;
const MOST_SHARE: f32 = 0.4;
/// Height of a label (points).
const WORD: f32 = 12.0;
/// Opacity of the legend's background.
const BACKING: f32 = 0.85;

/// Shape and its meaning.
pub struct Row {
    name: String,
    color: Color32,
    filled: bool,
}

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

    fn size_of(&self, text: &str) -> Vec2 {
        let font = FontId::proportional(WORD);
        self.painter
            .layout_no_wrap(text.to_owned(), font, Color32::WHITE)
            .size()
    }

    fn word(&self, place: Pos2, anchor: Align2, text: &str, color: Color32) {
        self.painter
            .text(place, anchor, text, FontId::proportional(WORD), color);
    }

    /// Labels axes and entry, but not under the legend: the axes lie in the same corner.
    pub fn landmarks(&self, corner_m: Option<[f32; 3]>, view: &ViewState, rows: &[Row]) {
        let legend = self.place_of(rows);
        let word = |place: Pos2, anchor: Align2, text: &str, color: Color32| {
            let size = self.size_of(text);
            if !anchor.anchor_size(place, size).intersects(legend) {
                self.word(place, anchor, text, color);
            }
        };
        if let Some(corner) = corner_m {
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                let mut end = corner;
                end[axis] += 0.0145;
                if let Some(place) = self.at(end) {
                    word(place, Align2::CENTER_CENTER, name, self.tokens.weak);
                }
            }
        }
        if let Some(plan) = &self.shown.plan
            && let Some(place) = self.at(plan.entry_m.map(|c| c as f32))
        {
            let above = place - Vec2::new(0.0, 16.0);
            word(above, Align2::CENTER_BOTTOM, "entry", self.tokens.entry);
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
        let text = format!("{length_mm:.0} mm");
        let middle = start + (end - start) * 0.5 - Vec2::new(0.0, 5.0);
        let word = Align2::CENTER_BOTTOM.anchor_size(middle, self.size_of(&text));
        let bar = Rect::from_two_pos(start, end).expand(4.0);
        self.fill_backing(bar.union(word).expand2(Vec2::new(3.0, 1.0)));
        let stroke = Stroke::new(2.0, self.tokens.path);
        self.painter.line_segment([start, end], stroke);
        for place in [start, end] {
            self.painter
                .line_segment([place - Vec2::new(0.0, 4.0), place + Vec2::new(0.0, 4.0)], stroke);
        }
        self.word(middle, Align2::CENTER_BOTTOM, &text, self.tokens.path);
    }

    /// Fills the background, because needles, seeds and the grid cross the same corners as the
    /// text.
    fn fill_backing(&self, rect: Rect) {
        let backing = self.tokens.background.gamma_multiply(BACKING);
        self.painter.rect_filled(rect, 3.0, backing);
    }

    /// Returns the drawn shapes, from the top down; none in a small picture, where the legend would
    /// hide them.
    pub fn listed(&self, look: Look, dose: Option<&DoseResult>) -> Vec<Row> {
        let mut rows = Vec::new();
        let mut list = |name: &str, color, filled| {
            rows.push(Row {
                name: name.to_owned(),
                color,
                filled,
            });
        };
        let t = self.tokens;
        if let Some(scene) = &self.shown.scene {
            for (kind, name) in named(scene) {
                list(&name, kind.color(t), true);
            }
        }
        if look.rest_shape {
            list("gland at rest", t.ghost, true);
        }
        if self.shown.plan.is_some() || self.shown.planning.implant.is_some() {
            list("planned seed", t.seed_planned, false);
        }
        if !self.shown.seeds.is_empty() {
            list("placed seed", t.seed_placed, true);
        }
        for shell in dose.iter().flat_map(|d| &d.shells).filter(|s| !s.points_m.is_empty()) {
            let of = dose.map_or("", |dose| dose.of.name());
            let text = format!("{:.0} % isodose, {of}", LEVELS[shell.level] * 100.0);
            list(&text, IMAGE.isodose[shell.level], true);
        }
        if rows.len() as f32 * ROW > MOST_SHARE * self.rect.height() {
            rows.clear();
        }
        rows
    }

    /// Returns the place of the rows, with a margin.
    fn place_of(&self, rows: &[Row]) -> Rect {
        if rows.is_empty() {
            return Rect::NOTHING;
        }
        let widest = rows.iter().map(|row| self.size_of(&row.name).x).fold(0.0, f32::max);
        let corner = self.rect.left_bottom() + Vec2::new(6.0, -4.0);
        let size = Vec2::new(27.0 + widest, ROW * rows.len() as f32 + 4.0);
        Rect::from_min_max(corner - Vec2::new(0.0, size.y), corner + Vec2::new(size.x, 0.0))
    }

    /// Draws the rows. A filled dot is a surface, a ring a mark that is only planned.
    pub fn rows(&self, rows: &[Row]) {
        if rows.is_empty() {
            return;
        }
        self.fill_backing(self.place_of(rows));
        let mut place = self.rect.left_bottom() + Vec2::new(16.0, -14.0);
        for row in rows.iter().rev() {
            if row.filled {
                self.painter.circle_filled(place, 4.5, row.color);
            } else {
                self.painter.circle_stroke(place, 4.0, Stroke::new(1.5, row.color));
            }
            self.word(
                place + Vec2::new(11.0, 0.0),
                Align2::LEFT_CENTER,
                &row.name,
                self.tokens.weak,
            );
            place.y -= ROW;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::theme::DARK;
    use bytemuck::Zeroable;
    use egui::Shape;
    use stylet_shm_schema::PlanInForce;

    /// Guards against labels under the legend in a small window: "z" of the axes stood under
    /// "body", "entry" under "gland". No test saw it, because without a graphics device there is no
    /// picture and no label.
    #[test]
    fn no_label_of_the_picture_overlaps_its_legend() {
        let mut shown = Shown::empty("lab");
        let mut plan = PlanInForce::zeroed();
        plan.entry_m = [0.03, 0.03, -0.02];
        shown.plan = Some(plan);
        let names = ["gland", "urethra", "bone", "body", "planned seed", "placed seed"];
        let rows = names.map(|name| Row {
            name: name.to_owned(),
            color: Color32::WHITE,
            filled: true,
        });
        let tokens = &DARK;
        let (mut left_out, mut painted) = (0, 0);
        for size in [[336.0, 236.0], [331.0, 366.0], [664.0, 734.0]] {
            for turn in 0..96 {
                let mut camera = Camera::default();
                camera.orbit([turn as f32 * 0.131, 0.2 * (turn % 7) as f32 - 0.6]);
                let rect = Rect::from_min_size(Pos2::new(10.0, 20.0), size.into());
                let words = words(rect, &camera, &shown, tokens, &rows);
                let (of_legend, others): (Vec<_>, Vec<_>) =
                    words.iter().partition(|(word, _)| names.contains(&word.as_str()));
                assert_eq!(of_legend.len(), names.len());
                painted += others.len();
                left_out += 4 - others.len();
                for (word, place) in &others {
                    for (name, row) in &of_legend {
                        assert!(
                            !place.shrink(0.5).intersects(row.shrink(0.5)),
                            "{word} over {name}, turn {turn}, {size:?}"
                        );
                    }
                }
            }
        }
        assert!(
            left_out > 5 && painted > 3 * left_out,
            "{left_out} left out, {painted} painted"
        );
    }

    fn words(rect: Rect, camera: &Camera, shown: &Shown, tokens: &'static Tokens, rows: &[Row]) -> Vec<(String, Rect)> {
        let ctx = egui::Context::default();
        let output = ctx.run_ui(egui::RawInput::default(), |ui| {
            let painter = ui.painter();
            let legend = Legend {
                painter,
                rect,
                camera,
                tokens,
                shown,
            };
            legend.landmarks(Some([0.06, -0.01, -0.03]), &ViewState::default(), rows);
            legend.rows(rows);
        });
        let word = |shape: &Shape| match shape {
            Shape::Text(text) => Some((text.galley.text().to_owned(), text.visual_bounding_rect())),
            _ => None,
        };
        output
            .shapes
            .iter()
            .filter_map(|clipped| word(&clipped.shape))
            .collect()
    }
}
