//! The operator's drawing on the picture of the probe: clicks on the edge of the gland and marks of
//! seeds.

use super::probe::ProbePicture;
use super::state::Tool;
use crate::action::{Action, PlanAction};
use crate::planner::{Edit, ReviewShown};
use crate::theme::{self, IMAGE};
use egui::{Key, Painter, PointerButton, Pos2, Sense, Shape, Stroke, Vec2};
use nalgebra::{Vector2, Vector3};
use stylet_imaging::ultrasound::View;
use stylet_implant::intraoperative::{Outline, Transverse};

/// Distance within which a click selects an existing one, in points.
const NEAR: f32 = 9.0;
/// Half the thickness of the slab whose marks are drawn, m: slightly more than half a seed.
const SLAB_M: f64 = 2.5e-3;

/// Part of the drawing that is being dragged.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Held {
    Click { at_m: f64, number: usize },
    Mark(usize),
}

/// Drag in one picture, from one frame to the next.
#[derive(Default)]
pub(super) struct Drawing {
    held: Option<Held>,
    /// True at the start of a drag, before any motion.
    is_first: bool,
}

impl Drawing {
    /// Draws the drawing over a picture. With a tool, clicks add, drags move, and the right button
    /// or Del remove.
    pub(super) fn draw_ui(
        &mut self,
        ui: &mut egui::Ui,
        picture: &ProbePicture,
        tool: Option<Tool>,
        review: &ReviewShown,
    ) -> Vec<Action> {
        let Some(frame) = review.frame else { return Vec::new() };
        let over = Over {
            painter: ui.painter_at(picture.rect),
            picture,
            review,
            frame,
            at_m: frame.in_plane_m(picture.plane.pose.middle_m).1,
        };
        let transverse = picture.plane.view == View::Transverse;
        let tool = tool.filter(|tool| transverse || *tool == Tool::Seeds);
        let mut edits = Vec::new();
        let mut near = None;
        if let Some(tool) = tool {
            let id = ui.scope_id().with(("drawing", picture.plane.view.name()));
            let response = ui.interact(picture.rect, id, Sense::click_and_drag());
            let name = format!("Draw in the {} picture", picture.plane.view.name().to_lowercase());
            theme::named(&response, egui::accesskit::Role::Canvas, || &name);
            near = response.hover_pos().and_then(|at| over.near(tool, at));
            edits = self.edits(ui, &response, tool, &over);
        }
        if transverse {
            over.outline();
            over.clicks(near);
        }
        over.marks(near);
        edits
            .into_iter()
            .map(|edit| Action::Plan(PlanAction::Draw(edit)))
            .collect()
    }

    fn edits(&mut self, ui: &egui::Ui, response: &egui::Response, tool: Tool, over: &Over) -> Vec<Edit> {
        let pressed_at = ui.input(|i| i.pointer.press_origin());
        if response.drag_started_by(PointerButton::Primary) {
            self.held = pressed_at.and_then(|at| over.near(tool, at));
            self.is_first = true;
        }
        if !response.dragged_by(PointerButton::Primary) {
            self.held = None;
        }
        let at = response.interact_pointer_pos();
        if let (Some(held), Some(at)) = (self.held, at) {
            let is_first = std::mem::take(&mut self.is_first);
            return over.moved(held, at, is_first).into_iter().collect();
        }
        let Some(at) = at.or(response.hover_pos()) else {
            return Vec::new();
        };
        let near = over.near(tool, at);
        let removes = response.secondary_clicked() || (response.hovered() && ui.input(|i| i.key_pressed(Key::Delete)));
        match near {
            Some(near) if removes => vec![removed(near)],
            None if response.clicked_by(PointerButton::Primary) => over.added(tool, at).into_iter().collect(),
            _ => Vec::new(),
        }
    }
}

fn removed(held: Held) -> Edit {
    match held {
        Held::Click { at_m, number } => Edit::Remove { at_m, number },
        Held::Mark(number) => Edit::RemoveMark(number),
    }
}

/// Picture with the drawing over it.
struct Over<'a> {
    painter: Painter,
    picture: &'a ProbePicture,
    review: &'a ReviewShown,
    frame: Transverse,
    /// Place of the transverse plane along the axis, m.
    at_m: f64,
}

impl Over<'_> {
    fn on_screen(&self, [right, up]: [f64; 2]) -> Pos2 {
        self.picture.at(self.frame.place_m(Vector2::new(right, up), self.at_m))
    }

    /// Returns the marks near the plane, with their numbers.
    fn marks_here(&self) -> impl Iterator<Item = (usize, Pos2)> + '_ {
        let marks = self.review.drawn.marks_m.iter().enumerate();
        let here = marks.map(|(n, place_m)| (n, Vector3::from(*place_m)));
        here.filter(|(_, place_m)| self.picture.distance_m(*place_m).abs() < SLAB_M)
            .map(|(n, place_m)| (n, self.picture.at(place_m)))
    }

    fn clicks_here(&self) -> impl Iterator<Item = (usize, Pos2)> + '_ {
        let clicks = self.review.drawn.contour.at(self.at_m);
        let points = clicks.map_or(&[][..], |clicks| &clicks.points_m);
        points.iter().enumerate().map(|(n, point)| (n, self.on_screen(*point)))
    }

    /// Returns the nearest click or mark within reach of a place of the window.
    fn near(&self, tool: Tool, at: Pos2) -> Option<Held> {
        let nearest = |all: &mut dyn Iterator<Item = (usize, Pos2)>| {
            let near = all.map(|(n, place)| (n, place.distance(at)));
            near.filter(|(_, off)| *off < NEAR)
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map(|(n, _)| n)
        };
        match tool {
            Tool::Contour => {
                let number = nearest(&mut self.clicks_here())?;
                Some(Held::Click {
                    at_m: self.at_m,
                    number,
                })
            }
            Tool::Seeds => nearest(&mut self.marks_here()).map(Held::Mark),
        }
    }

    /// Returns a place of the window in its transverse plane.
    fn in_plane(&self, at: Pos2) -> Option<[f64; 2]> {
        let place_m = self.picture.place_m(at)?;
        Some(self.frame.in_plane_m(place_m).0.into())
    }

    fn added(&self, tool: Tool, at: Pos2) -> Option<Edit> {
        Some(match tool {
            Tool::Contour => Edit::Add {
                at_m: self.at_m,
                point_m: self.in_plane(at)?,
            },
            Tool::Seeds => Edit::Mark(self.picture.place_m(at)?.into()),
        })
    }

    fn moved(&self, held: Held, at: Pos2, is_first: bool) -> Option<Edit> {
        Some(match held {
            Held::Click { at_m, number } => Edit::Move {
                at_m,
                number,
                to_m: self.in_plane(at)?,
                is_first,
            },
            Held::Mark(number) => Edit::MoveMark {
                number,
                to_m: self.picture.place_m(at)?.into(),
                is_first,
            },
        })
    }

    /// Draws the outline: solid if it goes through clicks of this plane, dashed if it is proposed.
    fn outline(&self) {
        let Some((outline, is_own)) = self.review.outline_at(self.at_m) else {
            return;
        };
        let line = self.line(&outline);
        let stroke = Stroke::new(if is_own { 1.8 } else { 1.4 }, IMAGE.drawn);
        match is_own {
            true => {
                self.painter.add(Shape::closed_line(line, stroke));
            }
            false => {
                let ring: Vec<Pos2> = line.iter().chain(line.first()).copied().collect();
                self.painter.extend(Shape::dashed_line(&ring, stroke, 6.0, 5.0));
            }
        }
    }

    fn line(&self, outline: &Outline) -> Vec<Pos2> {
        outline.points_m().map(|p| self.on_screen(p.into())).collect()
    }

    fn clicks(&self, near: Option<Held>) {
        for (n, at) in self.clicks_here() {
            let is_near = near
                == Some(Held::Click {
                    at_m: self.at_m,
                    number: n,
                });
            self.painter
                .circle_filled(at, if is_near { 5.5 } else { 3.5 }, IMAGE.drawn);
            self.painter
                .circle_stroke(at, if is_near { 5.5 } else { 3.5 }, Stroke::new(1.0, IMAGE.background));
        }
    }

    /// Draws a ring with a cross in it; a mark without a seed has no cross.
    fn marks(&self, near: Option<Held>) {
        let without_seed = &self.review.marks.without_seed;
        for (n, at) in self.marks_here() {
            let radius = if near == Some(Held::Mark(n)) { 8.0 } else { 6.0 };
            let stroke = Stroke::new(1.6, IMAGE.seed_placed);
            self.painter.circle_stroke(at, radius, stroke);
            if without_seed.contains(&n) {
                continue;
            }
            for arm in [Vec2::new(2.5, 2.5), Vec2::new(2.5, -2.5)] {
                self.painter.line_segment([at - arm, at + arm], stroke);
            }
        }
    }
}
