//! The template as seen from the perineum: patient's right at the left, anterior at the top.

use super::PlanState;
use crate::action::{Action, PlanAction};
use crate::planner::{Implant, NeedleState, Outline};
use crate::shown::Shown;
use crate::theme;
use crate::theme::Tokens;
use crate::view::kinds::Kind;
use egui::{
    Align2, Color32, EventFilter, FontId, Key, Modifiers, Painter, Pos2, Rect, Response, Sense, Shape, Stroke, Vec2,
};
use stylet_base::format;
use stylet_implant::plan::{HOLES, Hole, Loading};

/// Room for letters under the holes and numbers at their side.
const LETTERS: f32 = 16.0;
/// Distance between holes, in points.
const PITCHES: [f32; 2] = [16.0, 22.0];
/// Height of the parts below the template.
const BELOW: f32 = 400.0;
const NEEDLE: f32 = 5.5;

pub fn template_ui(
    ui: &mut egui::Ui,
    shown: &Shown,
    implant: &Implant,
    state: &mut PlanState,
    actions: &mut Vec<Action>,
) {
    let height = ui.available_height();
    let pitch = ((height - BELOW) / f32::from(HOLES))
        .clamp(PITCHES[0], PITCHES[1])
        .floor();
    let side = f32::from(HOLES) * pitch;
    let size = Vec2::new(ui.available_width(), side + LETTERS);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let left = rect.left() + LETTERS + (rect.width() - LETTERS - side) / 2.0;
    let board = Board {
        rect: Rect::from_min_size(Pos2::new(left, rect.top()), Vec2::splat(side)),
        pitch,
    };
    steer(ui, &response, implant, state, actions);
    let hovered = holes_ui(ui, &response, &board, implant, state);
    let name = || format!("Template, {}", hole_text(implant, state.hole));
    theme::named(&response, egui::accesskit::Role::Grid, name);
    let look = Look {
        painter: ui.painter_at(rect.expand(2.0)),
        board: &board,
        tokens: theme::of(ui),
    };
    look.background(&response);
    if let Some(outlines) = &shown.planning.outlines {
        let middle_m = (outlines.depths_m[0] + outlines.depths_m[1]) / 2.0;
        let depth_m = *state.depth_m.get_or_insert(middle_m);
        let layer = outlines.layer(depth_m);
        for (number, outline) in &layer.spared {
            let body = outlines.anatomy.spared.get(*number);
            let kind = body.map_or(Kind::Spared, |body| Kind::of_spared(&body.name));
            look.outline(outline, kind.panel_color(look.tokens), 1.2);
        }
        for outline in &layer.target {
            look.outline(outline, Kind::Gland.panel_color(look.tokens), 2.0);
        }
    }
    look.letters();
    look.holes(implant);
    look.chosen(state.hole);
    if let Some(hole) = hovered {
        response.on_hover_text_at_pointer(hole_text(implant, hole));
    }
    depth_ui(ui, shown, state, actions);
}

/// Returns hole, depth and seeds, in words.
fn hole_text(implant: &Implant, hole: Hole) -> String {
    let number = implant.plan.needles.iter().position(|n| n.hole == Some(hole));
    let Some(number) = number else {
        return format!("{hole}: no needle");
    };
    let needle = &implant.plan.needles[number];
    let joined = match needle.loading {
        Loading::Loose => "loose",
        Loading::Stranded { .. } => "in one strand",
    };
    format!(
        "{hole}: needle {}, {:.1} mm deep, {} seeds {joined}, {}",
        number + 1,
        format::mm(needle.depth_m),
        needle.seeds.len(),
        implant.states[number].name()
    )
}

/// Handles keys: arrows select a hole, with Shift they move the needle; Enter adds one, Delete
/// removes it.
fn steer(ui: &egui::Ui, response: &Response, implant: &Implant, state: &mut PlanState, actions: &mut Vec<Action>) {
    if !response.has_focus() || !ui.is_enabled() {
        return;
    }
    let filter = EventFilter {
        tab: false,
        horizontal_arrows: true,
        vertical_arrows: true,
        escape: false,
    };
    ui.memory_mut(|m| m.set_focus_lock_filter(response.id, filter));
    let arrows = [
        (Key::ArrowLeft, [-1, 0]),
        (Key::ArrowRight, [1, 0]),
        (Key::ArrowUp, [0, 1]),
        (Key::ArrowDown, [0, -1]),
    ];
    let pressed = |modifiers, key| ui.input_mut(|i| i.consume_key(modifiers, key));
    for (key, by) in arrows {
        let with_needle = pressed(Modifiers::SHIFT, key);
        if !with_needle && !pressed(Modifiers::NONE, key) {
            continue;
        }
        let Some(to) = state.hole.offset_by(by) else { continue };
        if with_needle && let Some(number) = state.needle(&implant.plan) {
            move_needle(implant, number, to, state, actions);
        } else {
            state.look_at_hole(to);
        }
    }
    let needle = state.needle(&implant.plan);
    if pressed(Modifiers::NONE, Key::Enter) && needle.is_none() {
        actions.push(Action::Plan(PlanAction::Add(state.hole)));
    }
    if pressed(Modifiers::NONE, Key::Delete)
        && let Some(number) = needle
    {
        actions.push(Action::Plan(PlanAction::Remove(number)));
    }
}

/// Moves a needle to a free hole.
pub fn move_needle(implant: &Implant, number: usize, to: Hole, state: &mut PlanState, actions: &mut Vec<Action>) {
    let is_free = implant.plan.needles.iter().all(|n| n.hole != Some(to));
    if is_free && implant.states[number] == NeedleState::Planned {
        state.look_at_hole(to);
        actions.push(Action::Plan(PlanAction::Move(number, to)));
    }
}

/// Draws the holes. Each can be clicked and has a name; the keys reach them through the template as
/// a whole.
fn holes_ui(
    ui: &egui::Ui,
    template: &Response,
    board: &Board,
    implant: &Implant,
    state: &mut PlanState,
) -> Option<Hole> {
    let mut hovered = None;
    for hole in Hole::all() {
        let rect = Rect::from_center_size(board.at(hole), Vec2::splat(board.pitch));
        let response = ui.interact(rect, template.id.with(hole), Sense::CLICK);
        theme::named(&response, egui::accesskit::Role::Button, || hole_text(implant, hole));
        if response.hovered() {
            hovered = Some(hole);
        }
        if response.clicked() {
            state.look_at_hole(hole);
            template.request_focus();
        }
    }
    hovered
}

/// Draws the choice of the outlines' plane, which the axial slice follows.
fn depth_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut PlanState, actions: &mut Vec<Action>) {
    let (Some(outlines), Some(depth_m)) = (&shown.planning.outlines, &mut state.depth_m) else {
        return;
    };
    ui.horizontal(|ui| {
        let label = ui.label(theme::small("Outline at depth"));
        let mut depth_mm = format::mm(*depth_m);
        let [near, far] = outlines.depths_m.map(format::mm);
        ui.spacing_mut().slider_width = ui.available_width() - 78.0;
        let slider = egui::Slider::new(&mut depth_mm, near.ceil()..=far.floor())
            .step_by(1.0)
            .suffix(" mm");
        let response = ui.add(slider).labelled_by(label.id);
        if response.changed() && (response.dragged() || response.has_focus()) {
            *depth_m = format::metres(depth_mm);
            actions.push(Action::Plan(PlanAction::LookAt(*depth_m)));
        }
    });
}

/// Positions of the holes on the screen.
struct Board {
    rect: Rect,
    pitch: f32,
}

impl Board {
    fn at(&self, hole: Hole) -> Pos2 {
        self.place([f32::from(hole.column()), f32::from(hole.row())])
    }

    fn place(&self, [column, row]: [f32; 2]) -> Pos2 {
        let half = self.pitch / 2.0;
        Pos2::new(
            self.rect.left() + half + column * self.pitch,
            self.rect.bottom() - half - row * self.pitch,
        )
    }
}

struct Look<'a> {
    painter: Painter,
    board: &'a Board,
    tokens: &'static Tokens,
}

impl Look<'_> {
    fn background(&self, response: &Response) {
        let color = match response.has_focus() {
            true => self.tokens.accent,
            false => self.tokens.line,
        };
        self.painter.rect(
            self.board.rect,
            3.0,
            self.tokens.background,
            Stroke::new(1.0, color),
            egui::StrokeKind::Outside,
        );
    }

    fn outline(&self, outline: &Outline, color: Color32, width: f32) {
        let inside = self.painter.with_clip_rect(self.board.rect);
        let points = outline.iter().map(|p| self.board.place(*p)).collect();
        inside.add(Shape::line(points, Stroke::new(width, color)));
    }

    fn letters(&self) {
        let font = FontId::proportional(11.0);
        let rect = self.board.rect;
        for n in 0..HOLES {
            let [column, row] =
                [Hole::new(n, 0), Hole::new(0, n)].map(|h| h.map(|h| self.board.at(h)).unwrap_or_default());
            let letter = char::from(b'A' + n).to_string();
            let below = Pos2::new(column.x, rect.bottom() + 2.0);
            self.painter
                .text(below, Align2::CENTER_TOP, letter, font.clone(), self.tokens.weak);
            let beside = Pos2::new(rect.left() - 4.0, row.y);
            let number = (n + 1).to_string();
            self.painter
                .text(beside, Align2::RIGHT_CENTER, number, font.clone(), self.tokens.weak);
        }
    }

    fn holes(&self, implant: &Implant) {
        for hole in Hole::all() {
            self.painter.circle_filled(self.board.at(hole), 1.3, self.tokens.weak);
        }
        let problems = implant.problems.as_deref().map_or(&[][..], |p| p);
        for (number, needle) in implant.plan.needles.iter().enumerate() {
            let Some(hole) = needle.hole else { continue };
            let at = self.board.at(hole);
            needle_mark(&self.painter, at, implant.states[number], self.tokens);
            if problems.iter().any(|p| p.needle == Some(number)) {
                let corner = at + Vec2::new(9.0, 0.0);
                let font = FontId::proportional(15.0);
                self.painter
                    .text(corner, Align2::CENTER_CENTER, "!", font, self.tokens.bad);
            }
        }
    }

    fn chosen(&self, hole: Hole) {
        let rect = Rect::from_center_size(self.board.at(hole), Vec2::splat(self.board.pitch - 1.0));
        let stroke = Stroke::new(2.0, self.tokens.accent);
        self.painter.rect_stroke(rect, 2.0, stroke, egui::StrokeKind::Inside);
    }
}

/// Draws the mark of a needle. Planned: an open ring; inserted: a triangle; done: a full square.
pub fn needle_mark(painter: &Painter, at: Pos2, state: NeedleState, tokens: &Tokens) {
    let stroke = Stroke::new(2.0, tokens.seed_planned);
    match state {
        NeedleState::Planned => drop(painter.circle(at, NEEDLE - 1.0, tokens.background, stroke)),
        NeedleState::Inserted => {
            let corners = [[0.0, -1.0], [0.95, 0.8], [-0.95, 0.8]].map(|[x, y]| at + Vec2::new(x, y) * NEEDLE);
            painter.add(Shape::convex_polygon(corners.to_vec(), tokens.warn, Stroke::NONE));
        }
        NeedleState::Done => {
            let square = Rect::from_center_size(at, Vec2::splat(NEEDLE * 1.6));
            painter.rect_filled(square, 0.0, tokens.good);
        }
    }
}
