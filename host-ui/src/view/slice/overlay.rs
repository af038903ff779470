//! Overlays of a slice: contours, isodose lines, needle, seeds, planned places, letters and scale.

use super::Contour;
use super::plane::Plane;
use super::polyline::simplified;
use crate::dose_worker::{DoseOf, DoseResult, LEVELS};
use crate::shown::Shown;
use crate::theme::IMAGE;
use crate::view::free::free_of_banners;
use crate::view::orientation::Orientation;
use crate::view::state::ViewState;
use egui::text::LayoutJob;
use egui::{Align, Align2, Color32, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2};
use nalgebra::Vector3;
use std::sync::Arc;
use stylet_base::format;
use stylet_shm_schema::SEED_LENGTH_M;
use stylet_surfaces::mesh::cut;

/// Distance from the plane within which a point is in it.
const IN_PLANE_M: f64 = 1.5e-3;
/// Half a seed: distance beyond which the plane does not cut it.
const SEED_HALF_M: f64 = 0.5 * SEED_LENGTH_M;
const NEEDLE_M: f64 = 0.12;
/// Drawn and blank points of an isodose line; outlines of structures are solid and wider.
const DASHES: [[f32; 2]; 4] = [[2.0, 3.0], [14.0, 2.0], [8.0, 3.0], [3.0, 2.0]];
const OUTLINE: f32 = 2.0;
const ISODOSE: f32 = 1.3;

/// Lines of one slice, cut again only when the plane or the surfaces have changed.
#[derive(Default)]
pub struct Lines {
    /// Plane and surface of the contours; plane and dose of the isodose lines.
    body: Option<([f64; 4], u64)>,
    dose: Option<([f64; 4], u64)>,
    contours: Vec<(Color32, cut::Line)>,
    /// Isodose lines by level, in the frame of the scene's body.
    isodoses: Vec<(usize, cut::Line)>,
}

impl Lines {
    /// Cuts the lines again if needed. `shift_m` leads from the scene's body to the drawn dose. A
    /// new dose is cut if `may_cut_dose`, else in a later frame; returns whether it was cut.
    pub fn update(
        &mut self,
        plane: &Plane,
        (positions_m, moved): (&[[f32; 3]], u64),
        contours: &[Contour],
        (dose, shift_m): (Option<&Arc<DoseResult>>, [f64; 3]),
        may_cut_dose: bool,
    ) -> bool {
        let normal = plane.normal();
        let offset_m = normal.dot(&plane.middle_m);
        let at = [normal.x, normal.y, normal.z, offset_m];
        let normal = [normal.x, normal.y, normal.z].map(|c| c as f32);
        if self.body != Some((at, moved)) {
            self.body = Some((at, moved));
            self.contours.clear();
            let sides = cut::Sides::of(positions_m, normal, offset_m as f32);
            for contour in contours {
                let lines = cut::cut(positions_m, &contour.triangles, &sides);
                self.contours
                    .extend(lines.into_iter().map(|line| (contour.color, line)));
            }
        }
        let offset_m = offset_m - plane.normal().dot(&Vector3::from(shift_m));
        let at = [at[0], at[1], at[2], offset_m];
        let key = (at, dose.map_or(0, |d| d.number));
        let is_old_plane = self.dose.is_some_and(|(plane, _)| plane == at);
        if self.dose == Some(key) || (is_old_plane && !may_cut_dose) {
            return false;
        }
        self.dose = Some(key);
        self.isodoses.clear();
        for shell in dose.iter().flat_map(|d| &d.shells) {
            let sides = cut::Sides::of(&shell.points_m, normal, offset_m as f32);
            let lines = cut::cut(&shell.points_m, &shell.triangles, &sides);
            self.isodoses.extend(lines.into_iter().map(|line| (shell.level, line)));
        }
        true
    }
}

/// Writes text in the middle of a picture, in as many lines as it takes.
pub fn words(painter: &Painter, rect: Rect, text: &str, color: Color32) {
    let font = FontId::proportional(12.5);
    let mut job = LayoutJob::simple(text.to_owned(), font, color, rect.width() - 48.0);
    job.halign = Align::Center;
    let galley = painter.layout_job(job);
    // Its positions count from the middle.
    let at = rect.center() - Vec2::new(0.0, galley.size().y / 2.0);
    painter.galley(at, galley, color);
}

/// Fills an empty picture with text in these colours: the background's, and the text's.
pub fn empty(painter: &Painter, rect: Rect, text: &str, (background, ink): (Color32, Color32)) {
    painter.rect_filled(rect, 0.0, background);
    words(painter, rect, text, ink);
}

/// Fills an empty picture; gives the reason if there is room for it.
pub fn reason(painter: &Painter, rect: Rect, why: &str, (background, ink): (Color32, Color32)) {
    const ROOM: f32 = 170.0;
    let why = if rect.height() >= ROOM { why } else { "" };
    empty(painter, rect, why, (background, ink));
}

/// Size below which a picture has no room for every label.
const ROOM_FOR_LEGEND: f32 = 170.0;
const ROOM_FOR_UPPER_LETTER: f32 = 270.0;
const ROOM_FOR_LETTERS: f32 = 80.0;

pub struct Overlay<'a> {
    pub painter: &'a Painter,
    pub plane: &'a Plane,
    pub orientation: Orientation,
    pub shown: &'a Shown,
    pub view: &'a ViewState,
}

impl Overlay<'_> {
    /// Draws the overlay. `shift_m` leads from the scene's body to the dose.
    pub fn draw(&self, lines: &Lines, dose_of: Option<DoseOf>, shift_m: [f64; 3]) {
        for (color, line) in &lines.contours {
            let stroke = Stroke::new(OUTLINE, *color);
            self.painter.add(Shape::line(self.points(line, [0.0; 3]), stroke));
        }
        for (level, line) in &lines.isodoses {
            self.isodose(*level, line, shift_m);
        }
        self.crosshair();
        self.planned();
        self.needles();
        self.placed();
        self.measure();
        self.letters();
        self.scale_bar();
        let has_room = self.plane.rect.height() >= ROOM_FOR_LEGEND;
        if let (Some(of), true, Orientation::Axial) = (dose_of, has_room, self.orientation) {
            self.isodose_legend(of.name());
        }
    }

    fn points(&self, line: &cut::Line, shift_m: [f64; 3]) -> Vec<Pos2> {
        let shift = Vector3::from(shift_m);
        let place = |p: &[f32; 3]| self.plane.on_screen(Vector3::from(*p).map(f64::from) + shift);
        simplified(line.iter().map(place))
    }

    fn isodose(&self, level: usize, line: &cut::Line, shift_m: [f64; 3]) {
        let (stroke, [dash, gap]) = (Stroke::new(ISODOSE, IMAGE.isodose[level]), DASHES[level]);
        let points = self.points(line, shift_m);
        self.painter.extend(Shape::dashed_line(&points, stroke, dash, gap));
    }

    /// Draws the other two slices as lines, open in the middle so that they hide nothing.
    fn crosshair(&self) {
        let (at, rect) = (self.plane.on_screen(self.view.cursor_m), self.plane.rect);
        let stroke = Stroke::new(1.0, IMAGE.crosshair.gamma_multiply(0.5));
        const OPEN: f32 = 14.0;
        self.painter
            .hline(rect.left()..=(at.x - OPEN).max(rect.left()), at.y, stroke);
        self.painter
            .hline((at.x + OPEN).min(rect.right())..=rect.right(), at.y, stroke);
        self.painter
            .vline(at.x, rect.top()..=(at.y - OPEN).max(rect.top()), stroke);
        self.painter
            .vline(at.x, (at.y + OPEN).min(rect.bottom())..=rect.bottom(), stroke);
    }

    /// Draws planned seeds as rings, unlike the bars of placed seeds.
    fn planned(&self) {
        let radius = (1.6e-3 / self.plane.m_per_point).max(4.0) as f32;
        let of_needle = self.shown.planned().iter().map(|s| s.position_m);
        let implant = self.shown.planning.implant.as_ref();
        let of_all = implant.iter().flat_map(|i| &i.seeds).map(|s| s.position_m);
        // The present needle is one of the plan's.
        let places = of_needle.filter(|_| implant.is_none()).chain(of_all);
        for place in places.map(Vector3::from) {
            if self.plane.distance_m(place).abs() < SEED_HALF_M {
                let stroke = Stroke::new(1.4, IMAGE.seed_planned);
                self.painter.circle_stroke(self.plane.on_screen(place), radius, stroke);
            }
        }
    }

    fn placed(&self) {
        let width = (0.8e-3 / self.plane.m_per_point).max(3.0) as f32;
        for seed in &self.shown.seeds {
            let (place, axis) = (Vector3::from(self.shown.drawn_at_m(seed)), Vector3::from(seed.axis));
            let reach = (axis.dot(&self.plane.normal()).abs() * SEED_HALF_M).max(IN_PLANE_M);
            if self.plane.distance_m(place).abs() > reach {
                continue;
            }
            let ends = [-1.0, 1.0].map(|end| self.plane.on_screen(place + axis * (SEED_HALF_M * end)));
            self.painter
                .line_segment(ends, Stroke::new(width + 2.0, IMAGE.background));
            self.painter.line_segment(ends, Stroke::new(width, IMAGE.seed_placed));
            self.painter
                .circle_filled(self.plane.on_screen(place), width * 0.8, IMAGE.seed_placed);
        }
    }

    /// Draws the moving needle over those that stay in.
    fn needles(&self) {
        for left in &self.shown.left {
            let (tip, direction) = (Vector3::from(left.tip_m), Vector3::from(left.direction));
            self.needle(&[tip, tip - direction * NEEDLE_M]);
        }
        if let Some(points_m) = self.shown.needle_points_m(NEEDLE_M) {
            let points: Vec<Vector3<f64>> = points_m.into_iter().map(Vector3::from).collect();
            self.needle(&points);
        }
    }

    /// Draws a needle: its part in the plane as a line, a dot if it crosses the plane, a ring about
    /// a tip in the plane.
    fn needle(&self, points: &[Vector3<f64>]) {
        let width = (1.27e-3 / self.plane.m_per_point).clamp(2.0, 8.0) as f32;
        let pieces: Vec<[Pos2; 2]> = points
            .windows(2)
            .filter_map(|ends| self.in_plane(ends[0], ends[1]))
            .collect();
        let length: f32 = pieces.iter().map(|ends| ends[0].distance(ends[1])).sum();
        if let ([first, ..], true) = (pieces.as_slice(), length < 2.0 * width) {
            let middle = first[0] + (first[1] - first[0]) * 0.5;
            self.painter.circle_filled(middle, width, IMAGE.needle);
            self.painter
                .circle_stroke(middle, width + 3.0, Stroke::new(1.0, IMAGE.needle.gamma_multiply(0.5)));
        } else {
            let behind = Stroke::new(width + 2.0, IMAGE.background.gamma_multiply(0.6));
            for ends in &pieces {
                self.painter.line_segment(*ends, behind);
            }
            let shaft = Stroke::new(width, IMAGE.needle.gamma_multiply(0.85));
            for ends in &pieces {
                self.painter.line_segment(*ends, shaft);
            }
        }
        if let Some(tip) = points
            .first()
            .filter(|tip| self.plane.distance_m(**tip).abs() < IN_PLANE_M)
            && !pieces.is_empty()
        {
            self.painter
                .circle_stroke(self.plane.on_screen(*tip), width + 3.0, Stroke::new(1.5, IMAGE.needle));
        }
    }

    /// Returns the part of a piece of needle that lies in the plane, on the screen.
    fn in_plane(&self, front: Vector3<f64>, end: Vector3<f64>) -> Option<[Pos2; 2]> {
        let length_m = (front - end).norm();
        let direction = (front - end).try_normalize(1e-9)?;
        let (at_front, per_m) = (self.plane.distance_m(front), -direction.dot(&self.plane.normal()));
        // Distances back from the front at which the shaft is a given distance in front of the
        // plane.
        let back = |distance: f64| ((distance - at_front) / per_m).clamp(0.0, length_m);
        let (near, far) = if per_m.abs() < 1e-6 {
            let is_in = at_front.abs() < IN_PLANE_M;
            (0.0, if is_in { length_m } else { 0.0 })
        } else {
            let (a, b) = (back(-IN_PLANE_M), back(IN_PLANE_M));
            (a.min(b), a.max(b))
        };
        let place = |way: f64| self.plane.on_screen(front - direction * way);
        (far > near).then(|| [place(near), place(far)])
    }

    fn measure(&self) {
        let points = self.view.measure.points_m();
        let places: Vec<Pos2> = points.iter().map(|p| self.plane.on_screen(*p)).collect();
        for place in &places {
            self.painter.circle_stroke(*place, 4.0, Stroke::new(1.5, IMAGE.measure));
        }
        if let ([a, b], Some(length_m)) = (places.as_slice(), self.view.measure.length_m()) {
            self.painter.line_segment([*a, *b], Stroke::new(1.5, IMAGE.measure));
            let middle = *a + (*b - *a) * 0.5 + Vec2::new(6.0, -6.0);
            self.word(
                middle,
                Align2::LEFT_BOTTOM,
                &format::length(length_m),
                12.5,
                IMAGE.measure,
            );
        }
    }

    /// Writes text on a dark background, legible on any tissue.
    fn word(&self, at: Pos2, anchor: Align2, text: &str, size: f32, color: Color32) -> Rect {
        let galley = self
            .painter
            .layout_no_wrap(text.to_owned(), FontId::proportional(size), color);
        let rect = anchor.anchor_size(at, galley.size());
        let background = IMAGE.background.gamma_multiply(0.66);
        self.painter
            .rect_filled(rect.expand2(Vec2::new(3.0, 0.0)), 2.0, background);
        self.painter.galley(rect.min, galley, color);
        rect
    }

    /// Returns the part of the picture without banners.
    fn free(&self) -> Rect {
        free_of_banners(self.painter.ctx(), self.plane.rect)
    }

    fn letters(&self) {
        let rect = self.plane.rect.shrink(6.0);
        let free = self.free().shrink(6.0);
        let [left, right, top, bottom] = self.orientation.letters();
        let word = |at, anchor, text| self.word(at, anchor, text, 12.0, IMAGE.text);
        if rect.height() >= ROOM_FOR_LETTERS {
            word(rect.left_center(), Align2::LEFT_CENTER, left);
            word(rect.right_center(), Align2::RIGHT_CENTER, right);
        }
        if rect.width() >= ROOM_FOR_UPPER_LETTER {
            word(free.center_top(), Align2::CENTER_TOP, top);
        }
        word(rect.center_bottom(), Align2::CENTER_BOTTOM, bottom);
        let title = format!("{}  {}", self.orientation.name(), self.place());
        self.word(
            free.left_top() + Vec2::new(3.0, 0.0),
            Align2::LEFT_TOP,
            &title,
            12.5,
            IMAGE.text,
        );
    }

    /// Returns the place of the slice in the patient.
    fn place(&self) -> String {
        let Some(scene) = &self.shown.scene else {
            return String::new();
        };
        let axis = self.orientation.across();
        let letter = ["R", "A", "S"][axis];
        let in_patient = scene.patient().patient_from_scene(self.plane.middle_m.into())[axis];
        format!("{letter} {}", format::length(in_patient))
    }

    /// Writes the tissue under the pointer below the title.
    pub fn tissue(&self, name: &str) {
        if !name.is_empty() {
            let at = self.free().left_top() + Vec2::new(9.0, 24.0);
            self.word(at, Align2::LEFT_TOP, name, 12.0, IMAGE.text);
        }
    }

    fn scale_bar(&self) {
        let length_mm = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0]
            .into_iter()
            .find(|&mm| format::metres(mm) / self.plane.m_per_point >= 34.0)
            .unwrap_or(100.0);
        let length = (format::metres(length_mm) / self.plane.m_per_point) as f32;
        let end = self.plane.rect.right_bottom() - Vec2::new(12.0, 10.0);
        let start = end - Vec2::new(length, 0.0);
        self.painter.line_segment([start, end], Stroke::new(2.0, IMAGE.text));
        let middle = start + (end - start) * 0.5 - Vec2::new(0.0, 3.0);
        self.word(
            middle,
            Align2::CENTER_BOTTOM,
            &format!("{length_mm:.0} mm"),
            11.0,
            IMAGE.text,
        );
    }

    fn isodose_legend(&self, of: &str) {
        let mut at = self.plane.rect.left_bottom() + Vec2::new(10.0, -10.0);
        for level in (0..LEVELS.len()).rev() {
            let text = format!("{:.0} % {of}", LEVELS[level] * 100.0);
            let rect = self.word(at + Vec2::new(26.0, 0.0), Align2::LEFT_BOTTOM, &text, 11.0, IMAGE.text);
            let y = rect.center().y;
            let ends = [Pos2::new(at.x, y), Pos2::new(at.x + 20.0, y)];
            let (stroke, [dash, gap]) = (Stroke::new(2.0, IMAGE.isodose[level]), DASHES[level]);
            self.painter.extend(Shape::dashed_line(&ends, stroke, dash, gap));
            at.y -= 16.0;
        }
    }
}
