//! Three orthogonal slices through the deformed body that look like ultrasound, with their
//! overlays.

mod gpu;
mod overlay;
mod plane;
mod polyline;
mod speckle;

use super::body::ShownBody;
use super::driver::DriverCost;
use super::kinds::{Kind, kinds};
use super::orientation::{Orientation, scene_from_patient};
use super::state::ViewState;
use crate::action::Action;
use crate::dose_worker::DoseResult;
use crate::shown::Shown;
use crate::theme::{self, IMAGE};
use eframe::egui_wgpu::RenderState;
use egui::{Color32, PointerButton, Pos2, Rect, Sense};
pub use gpu::ImageError;
use gpu::SliceGpu;
use nalgebra::{Matrix3, Vector3};
use overlay::{Lines, Overlay};
pub use overlay::{empty, reason, words};
pub use plane::Plane;
use std::sync::Arc;
use stylet_files::Image;
use stylet_host::link::SceneModel;
use stylet_shm_schema::{SceneHeader, SceneId, Text};
use stylet_surfaces::bodies::Bodies;

/// Initial view, in multiples of the target.
const MARGIN: f64 = 1.45;
const ZOOMS: [f64; 2] = [0.2, 12.0];
/// Distance from the tip within which a drag pulls the needle, in points.
const HANDLE: f32 = 16.0;
const M_PER_SCROLLED_POINT: f64 = 0.05e-3;

/// Surface whose cut is drawn, and its colour.
struct Contour {
    color: Color32,
    triangles: Vec<[u32; 3]>,
}

/// Three slices.
pub(super) struct Slices {
    gpu: Option<SliceGpu>,
    scene: Option<SceneId>,
    /// Number of the displacements on the card.
    stirred: u64,
    scene_from_patient: Matrix3<f64>,
    contours: Vec<Contour>,
    /// Centre of all pictures, and their scale.
    middle_m: Vector3<f64>,
    extent_m: f64,
    zoom: f64,
    lines: [Lines; 3],
    /// Name of the image, and of the scene that it belongs to.
    image: Option<(String, Text<64>)>,
    /// Frame in which a new dose was cut last.
    dose_cut_in: u64,
    /// True while the pointer holds the needle.
    holds_needle: bool,
}

impl Slices {
    /// Creates slices on this graphics device; without one they show no tissue.
    pub fn new(state: Option<RenderState>) -> Self {
        Self {
            gpu: state.as_ref().map(SliceGpu::new),
            scene: None,
            stirred: 0,
            scene_from_patient: Matrix3::identity(),
            contours: Vec::new(),
            middle_m: Vector3::repeat(0.03),
            extent_m: 0.06,
            zoom: 1.0,
            lines: Default::default(),
            image: None,
            dose_cut_in: 0,
            holds_needle: false,
        }
    }

    /// Returns the cost of the pictures since the window opened.
    pub fn driver(&self) -> DriverCost {
        self.gpu.as_ref().map_or_else(DriverCost::default, |gpu| gpu.driver)
    }

    /// Takes the data that arrived since the last frame.
    pub fn take(&mut self, body: &ShownBody, view: &mut ViewState) {
        let (Some(model), Some(bodies)) = (&body.model, body.bodies()) else {
            return;
        };
        let key = model.header.id();
        if self.scene != Some(key) {
            self.scene = Some(key);
            self.contours = contours(&model.header, bodies);
            self.take_scene(model);
            view.cursor_m = self.middle_m;
        }
        let (field, stirred) = (&body.field, body.stirred);
        if let Some(gpu) = self.gpu.as_mut().filter(|_| self.stirred != stirred) {
            gpu.set_field(field);
        }
        self.stirred = stirred;
    }

    fn take_scene(&mut self, model: &SceneModel) {
        self.scene_from_patient = scene_from_patient(&model.header);
        let (low, high) = (
            Vector3::from(model.header.target_lower_m),
            Vector3::from(model.header.target_upper_m),
        );
        self.middle_m = (low + high) / 2.0;
        self.extent_m = ((high - low).max() * MARGIN).clamp(1e-3, 2.0);
        self.zoom = 1.0;
        self.image
            .take_if(|(_, scene)| scene.read() != model.header.name.read());
        if let Some(gpu) = &mut self.gpu {
            if self.image.is_none() {
                gpu.forget_image();
            }
            gpu.set_scene(model, self.scene_from_patient);
        }
    }

    /// Shows an image of the patient of a scene, until another scene is loaded.
    pub fn show_image(&mut self, image: Image, scene: &str) -> Result<(), ImageError> {
        let Some(gpu) = &mut self.gpu else {
            return Err(ImageError::NoDevice);
        };
        let name = image.name.clone();
        gpu.set_image(image)?;
        self.image = Some((name, Text::new(scene)));
        Ok(())
    }

    /// Returns the name of the image that was loaded.
    pub fn image_name(&self) -> Option<&str> {
        self.image.as_ref().map(|(name, _)| name.as_str())
    }

    /// Shows the whole target again.
    pub fn reset_view(&mut self, shown: &Shown) {
        self.zoom = 1.0;
        if let Some(scene) = &shown.scene {
            self.middle_m = (Vector3::from(scene.target_lower_m) + Vector3::from(scene.target_upper_m)) / 2.0;
        }
    }

    /// Returns the plane that a picture of this size shows.
    pub fn plane(&self, orientation: Orientation, view: &ViewState, rect: Rect) -> Plane {
        let m_per_point = self.extent_m / self.zoom / f64::from(rect.width().min(rect.height()).max(20.0));
        let mut plane = Plane::new(orientation, &self.scene_from_patient, self.middle_m, m_per_point, rect);
        plane.middle_m += plane.normal() * plane.distance_m(view.cursor_m);
        plane
    }

    /// Draws one slice; returns the requests of the pointer.
    pub fn slice_ui(
        &mut self,
        ui: &mut egui::Ui,
        rect: Rect,
        orientation: Orientation,
        (shown, dose, body): (&Shown, Option<&Arc<DoseResult>>, &ShownBody),
        view: &mut ViewState,
    ) -> Option<Action> {
        let id = ui.scope_id().with(orientation.name());
        let response = ui.interact(rect, id, Sense::click_and_drag());
        let name = || format!("{} slice", orientation.name());
        theme::named(&response, egui::accesskit::Role::Image, name);
        if response.hovered() {
            self.scroll(ui, orientation, view, rect);
        }
        let plane = self.plane(orientation, view, rect);
        let action = self.steer(&response, &plane, shown, view);
        let painter = ui.painter_at(rect);
        if shown.scene.is_none() {
            let text = format!("{}: no scene yet", orientation.name());
            empty(&painter, rect, &text, (IMAGE.background, IMAGE.text));
            return None;
        }
        let scale = ui.ctx().pixels_per_point();
        let number = orientation as usize;
        match self
            .gpu
            .as_mut()
            .and_then(|gpu| gpu.picture(number, &plane, scale, view.image))
        {
            Some(picture) => picture.paint(&painter, rect),
            None => {
                let why = "No slice: no wgpu device, or the scene is too large for it";
                reason(&painter, rect, why, (IMAGE.background, IMAGE.text));
            }
        }
        let dose = dose.filter(|_| view.isodose);
        // One slice a frame, so that no frame waits for all three.
        let pass = ui.ctx().cumulative_pass_nr();
        let surface = (&body.positions_m[..], body.moved);
        let shift_m = dose.map_or([0.0; 3], |d| d.shift_m(shown.body_moved_m));
        let may_cut_dose = self.dose_cut_in != pass;
        if self.lines[number].update(&plane, surface, &self.contours, (dose, shift_m), may_cut_dose) {
            self.dose_cut_in = pass;
        }
        let overlay = Overlay {
            painter: &painter,
            plane: &plane,
            orientation,
            shown,
            view,
        };
        overlay.draw(&self.lines[number], dose.map(|dose| dose.of), shift_m);
        if let Some(place) = response.hover_pos() {
            overlay.tissue(&tissue_at(body, plane.in_scene(place)));
        }
        action
    }

    /// Handles the wheel: it scrolls through the slices, and zooms with Ctrl.
    fn scroll(&mut self, ui: &egui::Ui, orientation: Orientation, view: &mut ViewState, rect: Rect) {
        let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        if pinch != 1.0 {
            self.zoom = (self.zoom * f64::from(pinch)).clamp(ZOOMS[0], ZOOMS[1]);
        } else if scroll != 0.0 {
            let normal = self.plane(orientation, view, rect).normal();
            view.leave_tip();
            view.cursor_m += normal * f64::from(scroll) * M_PER_SCROLLED_POINT;
        }
    }

    fn steer(
        &mut self,
        response: &egui::Response,
        plane: &Plane,
        shown: &Shown,
        view: &mut ViewState,
    ) -> Option<Action> {
        if response.dragged_by(PointerButton::Secondary) || response.dragged_by(PointerButton::Middle) {
            let by = response.drag_delta();
            self.middle_m -= (plane.right * f64::from(by.x) - plane.up * f64::from(by.y)) * plane.m_per_point;
            return None;
        }
        let place = response.interact_pointer_pos()?;
        if response.drag_started_by(PointerButton::Primary) {
            self.holds_needle = !view.measure.active && is_on_tip(plane, shown, place - response.total_drag_delta()?);
        }
        if self.holds_needle && response.dragged_by(PointerButton::Primary) {
            let depth_m = shown.depth_of_m(plane.in_scene(place).into())?;
            return Some(Action::DriveTo(depth_m));
        }
        self.holds_needle = false;
        if response.clicked() && view.measure.active {
            view.measure.take(plane.in_scene(place));
        } else if !view.measure.active && (response.clicked() || response.dragged_by(PointerButton::Primary)) {
            view.leave_tip();
            view.cursor_m = plane.in_scene(place);
        }
        None
    }
}

/// Returns the name of the tissue at a place now; empty outside.
fn tissue_at(body: &ShownBody, place_m: Vector3<f64>) -> String {
    let Some(model) = &body.model else {
        return String::new();
    };
    let number = usize::from(model.label_at(body.field.rest_of_m(place_m).into()));
    let structure = number.checked_sub(1).and_then(|s| model.header.structures().get(s));
    structure.map_or_else(String::new, |s| s.name.read())
}

fn is_on_tip(plane: &Plane, shown: &Shown, place: Pos2) -> bool {
    let along = |d: [f64; 3]| Vector3::from(d).dot(&plane.normal()).abs() < 0.5;
    let (Some(tip), Some(plan)) = (shown.tip_m(), &shown.plan) else {
        return false;
    };
    along(plan.direction) && plane.on_screen(tip.into()).distance(place) < HANDLE
}

/// Returns the contours of a scene: its targets, spared and fixed structures; the whole body if it
/// has only one.
fn contours(header: &SceneHeader, bodies: &Bodies) -> Vec<Contour> {
    let all = kinds(Some(header)).zip(&bodies.parts);
    let looked_at = all.filter(|(kind, _)| *kind != Kind::Body);
    looked_at
        .map(|(kind, part)| Contour {
            color: kind.image_color(),
            triangles: bodies.triangles.get(part.clone()).unwrap_or(&[]).to_vec(),
        })
        .collect()
}
