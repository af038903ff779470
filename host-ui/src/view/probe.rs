//! The pictures of the ultrasound probe: both of its planes, with the template's grid over the
//! transverse one.

mod picture;
mod scale;
mod tools;
mod turns;

use super::body::ShownBody;
use super::free::free_of_banners;
use super::paste::{Paste, Pasted, gpu_of};
use super::slice::{empty, reason};
use crate::action::{Action, ProbeAction};
use crate::shown::Shown;
use crate::theme::{self, IMAGE};
use eframe::egui_wgpu::RenderState;
use egui::{Align2, FontId, Pos2, Rect, Sense, Vec2};
use nalgebra::Vector3;
pub use picture::ProbePicture;
use stylet_base::format;
use stylet_imaging::ultrasound::{Plane, Pose, Probe, Scanner, Settings, View};
use stylet_imaging::{Body, Metal};
use stylet_implant::plan::{Hole, Template};
use stylet_shm_schema::{SceneHeader, SceneId};
use stylet_surfaces::field::Field;
use tools::Knobs;
use turns::Turns;

/// Largest size of the longer side, in pixels.
const LARGEST_SIDE: f32 = 1024.0;
/// Length of a drag that moves the probe by 1 mm, or turns it by 1 degree.
const POINTS_PER_MM: f64 = 4.0;
const POINTS_PER_DEG: f64 = 3.0;

/// Scene data of one frame.
pub(super) type SceneData<'a> = (&'a Shown, &'a ShownBody, &'a Field);

/// Picture of one plane, and its inputs.
struct Pane {
    scanner: Scanner,
    scene: Option<SceneId>,
    drawn: Option<(Plane, Settings, Metal, Field)>,
    pasted: Option<Pasted>,
    /// Picture as it stands in the window.
    shown: Option<ProbePicture>,
}

/// Both planes of the probe.
pub(super) struct ProbeView {
    paste: Option<Paste>,
    panes: Vec<Pane>,
    knobs: Knobs,
    turns: Turns,
}

impl ProbeView {
    /// Creates the view. Without a graphics device that computes there are no pictures.
    pub fn new(state: Option<RenderState>) -> Self {
        let state = state.filter(|state| gpu_of(state).computes());
        Self {
            paste: state.as_ref().map(Paste::new),
            panes: state.map_or_else(Vec::new, |state| {
                let pane = |_| Pane {
                    scanner: Scanner::new(gpu_of(&state)),
                    scene: None,
                    drawn: None,
                    pasted: None,
                    shown: None,
                };
                View::ALL.map(pane).into()
            }),
            knobs: Knobs::default(),
            turns: Turns::default(),
        }
    }

    /// Returns the picture of a plane as it stood in the window in the last frame; `None` if it was
    /// not shown.
    pub fn picture(&self, view: View) -> Option<&ProbePicture> {
        self.panes.get(view as usize)?.shown.as_ref()
    }

    /// Forgets the pictures of the last frame.
    pub fn forget_pictures(&mut self) {
        for pane in &mut self.panes {
            pane.shown = None;
        }
    }

    /// Returns the pose of the probe: in the hand that holds the second device, or on the stepper
    /// without one.
    fn pose(&self, shown: &Shown, scene: &SceneHeader) -> Pose {
        let on_stepper = || self.knobs.stepper(&Pose::of_scene(scene));
        shown.probe_pose().unwrap_or_else(on_stepper)
    }

    /// Draws one plane; returns the requests of the pointer.
    pub fn picture_ui(&mut self, ui: &mut egui::Ui, rect: Rect, view: View, seen: SceneData<'_>) -> Option<Action> {
        let (shown, body, field) = seen;
        let response = ui.interact(rect, ui.scope_id().with(view.name()), Sense::click_and_drag());
        let name = format!("{} ultrasound", view.name());
        theme::named(&response, egui::accesskit::Role::Image, || &name);
        let painter = ui.painter_at(rect);
        let Some(model) = body.model.as_ref().filter(|_| shown.scene.is_some()) else {
            let text = format!("{name}: no scene yet");
            empty(&painter, rect, &text, (IMAGE.background, IMAGE.text));
            return None;
        };
        let action = self.dragged(&response, view, shown);
        let plane = Plane {
            pose: self.pose(shown, &model.header),
            view,
            probe: Probe::default(),
            depth_m: self.knobs.depth_mm * 1e-3,
            pixels: pixels(rect, ui.ctx().pixels_per_point()),
        };
        let settings = Settings {
            gain_db: self.knobs.gain_db,
            ..Settings::default()
        };
        let pass = ui.ctx().cumulative_pass_nr();
        if let (Some(pane), Some(paste)) = (self.panes.get_mut(view as usize), &self.paste) {
            let wanted = (plane, settings, shown.metal(), field);
            let may_compute = self.turns.is_on(view, pass);
            let (is_new, is_old) = pane.bring_up_to_date(model, wanted, paste, may_compute);
            if is_new {
                self.turns.took(view, pass);
            } else if is_old {
                self.turns.waits(view, pass);
                ui.ctx().request_repaint();
            }
            if let (Some(pasted), Some((drawn, ..))) = (&pane.pasted, &pane.drawn) {
                let picture = ProbePicture {
                    plane: *drawn,
                    rect,
                    is_live: !is_old,
                };
                pane.shown = Some(picture);
                pasted.paint(&painter, rect);
                self.over(&painter, &picture, (shown, plane.pose), &model.header);
                return action;
            }
            if is_old {
                // It is the other plane's turn; this one is next.
                painter.rect_filled(rect, 0.0, IMAGE.background);
                return action;
            }
        }
        let why = "No ultrasound: no wgpu device that computes, or the scene is too large for it";
        reason(&painter, rect, why, (IMAGE.background, IMAGE.text));
        action
    }

    /// Converts a drag: along the picture's height the probe goes in and out, along its width it
    /// turns.
    fn dragged(&mut self, response: &egui::Response, view: View, shown: &Shown) -> Option<Action> {
        if !response.dragged() {
            return None;
        }
        let by = response.drag_delta();
        let (across, up) = (f64::from(by.x), f64::from(-by.y));
        // In the sagittal picture the direction into the patient is to the right.
        let (way_mm, turn_deg) = match view {
            View::Transverse => (up / POINTS_PER_MM, across / POINTS_PER_DEG),
            View::Sagittal => (across / POINTS_PER_MM, up / POINTS_PER_DEG),
        };
        self.knobs.step(shown, way_mm, turn_deg).then(|| {
            Action::Probe(ProbeAction::Drag {
                way_m: way_mm * 1e-3,
                turn_rad: turn_deg.to_radians(),
            })
        })
    }

    /// Draws title, depths and template.
    fn over(
        &self,
        painter: &egui::Painter,
        picture: &ProbePicture,
        (shown, pose): (&Shown, Pose),
        scene: &SceneHeader,
    ) {
        let (plane, rect) = (&picture.plane, picture.rect);
        if self.knobs.template && plane.view == View::Transverse {
            let template = Template::before(scene);
            for hole in Hole::all() {
                let place_m = Vector3::from(template.hole_m(hole));
                if let Some(place_m) = plane.crossing_m(place_m, template.inwards.into()) {
                    painter.circle_filled(picture.at(place_m), 1.3, IMAGE.gland.gamma_multiply(0.8));
                }
            }
        }
        let (way_m, turn_rad) = pose.way_and_turn(&Pose::of_scene(scene));
        let whose = if shown.probe_pose().is_some() {
            "Hand 2"
        } else {
            "Stepper"
        };
        let (name, way, turn) = (plane.view.name(), format::length(way_m), turn_rad.to_degrees());
        // Avoid a minus before a zero.
        let turn = if turn.abs() < 0.05 { 0.0 } else { turn };
        let free = free_of_banners(painter.ctx(), rect);
        scale::draw(painter, picture, free);
        let at: Pos2 = free.left_top() + Vec2::new(9.0, 6.0);
        let text = format!("{name}\n{whose}  {way}  {turn:.1}°");
        painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(12.5), IMAGE.text);
        if let Some(remedy) = outside(&pose, scene) {
            let text = format!("The probe is outside the body.\n{remedy}");
            let font = FontId::proportional(13.5);
            painter.text(rect.center(), Align2::CENTER_CENTER, text, font, IMAGE.text);
        }
    }
}

/// Returns what moves the probe back to the body, if no part of the body is beside it.
fn outside(pose: &Pose, scene: &SceneHeader) -> Option<&'static str> {
    let along = |corner: usize| {
        let ends = [scene.lower_m, scene.upper_m];
        let place_m = Vector3::from([0, 1, 2].map(|a| ends[corner >> a & 1][a]));
        (place_m - pose.middle_m).dot(&pose.axis)
    };
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for off_m in (0..8).map(along) {
        (least, most) = (least.min(off_m), most.max(off_m));
    }
    match (least > 0.0, most < 0.0) {
        (true, _) => Some("PgUp moves it in."),
        (_, true) => Some("PgDn moves it out."),
        _ => None,
    }
}

impl Pane {
    /// Computes the picture if its inputs have changed. Returns whether it did, and whether the
    /// picture is out of date.
    fn bring_up_to_date(
        &mut self,
        model: &stylet_host::link::SceneModel,
        (plane, settings, metal, field): (Plane, Settings, Metal, &Field),
        paste: &Paste,
        may_compute: bool,
    ) -> (bool, bool) {
        let is_new_scene = self.scene != Some(model.header.id());
        let is_drawn = self
            .drawn
            .as_ref()
            .is_some_and(|drawn| (&drawn.0, &drawn.1, &drawn.2, &drawn.3) == (&plane, &settings, &metal, field));
        if is_drawn && !is_new_scene {
            return (false, false);
        }
        if !may_compute {
            return (false, true);
        }
        if is_new_scene {
            self.scene = Some(model.header.id());
            if let Some(body) = Body::of_scene(&model.header, &model.labels) {
                self.scanner.set_body(&body, field);
            }
        }
        self.scanner.set_field(field);
        let view = self.scanner.picture(&plane, &settings, &metal);
        let is_enlarged = plane.pixels.iter().any(|&side| side as f32 >= LARGEST_SIDE);
        self.pasted = view.map(|view| match is_enlarged {
            true => paste.enlarged(&view),
            false => paste.of(&view),
        });
        self.drawn = Some((plane, settings, metal, field.clone()));
        (true, false)
    }
}

/// Returns the pixels of a picture at this place; a large one has fewer and is enlarged.
fn pixels(rect: Rect, per_point: f32) -> [u32; 2] {
    let size = rect.size() * per_point;
    let share = (LARGEST_SIDE / size.max_elem().max(1.0)).min(1.0);
    [size.x, size.y].map(|side| ((side * share).round() as u32).max(16))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn a_probe_outside_the_body_says_which_way_is_in() {
        let mut scene = SceneHeader::zeroed();
        (scene.lower_m, scene.upper_m) = ([0.0; 3], [0.1; 3]);
        let (pose, along) = (Pose::of_scene(&scene), Pose::of_scene(&scene).axis);
        let moved = |m: f64| Pose {
            middle_m: Vector3::from([0.05; 3]) + along * m,
            ..pose
        };
        assert_eq!(outside(&moved(0.0), &scene), None);
        assert_eq!(outside(&moved(0.049), &scene), None);
        assert_eq!(outside(&moved(-0.06), &scene), Some("PgUp moves it in."));
        assert_eq!(outside(&moved(0.06), &scene), Some("PgDn moves it out."));
    }
}
