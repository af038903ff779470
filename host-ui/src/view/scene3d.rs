//! The three-dimensional picture: its content, and its rotation by the pointer.

use super::body::ShownBody;
use super::camera::Camera;
use super::collected::{collect_fixed, collect_live, moving_points};
use super::driver::DriverCost;
use super::gpu::SceneGpu;
use super::kinds::{kinds, surfaces};
use super::legend::Legend;
use super::marks::Marks;
use super::orientation::scene_from_patient;
use super::paste::Pasted;
use super::pick::pick;
use super::slice::reason;
use super::state::ViewState;
use super::uniforms::{SceneUniform, section, shifted, tint, uniform};
use crate::action::Viewpoint;
use crate::dose_worker::DoseResult;
use crate::shown::Shown;
use crate::theme::{self, IMAGE, Tokens};
use eframe::egui_wgpu::RenderState;
use egui::{PointerButton, Rect, Sense};
use nalgebra::Vector3;
use std::sync::Arc;
use stylet_shm_schema::SceneId;
use stylet_surfaces::mesh::Surface;

const TURN_PER_POINT_RAD: f32 = 0.008;
/// Distance of the needle's own view behind the tip.
const NEEDLE_VIEW_M: f32 = 0.06;
/// Width beyond which a picture has room for dose labels.
const ALONE: f32 = 500.0;
/// Smallest visible change, so that a force and a tip at rest leave the picture unchanged.
const SEEN_M: f64 = 2e-5;
const SEEN_N: f64 = 0.02;
/// Opacity of isodose surfaces.
const SHELL: f32 = 0.30;

/// Settings of a person; the same settings and the same data give the same picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Transparency: 0 opaque, 1 invisible.
    pub transparency: f32,
    pub rest_shape: bool,
    pub force: bool,
    pub template: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            transparency: 0.55,
            rest_shape: false,
            force: true,
            template: false,
        }
    }
}

/// Inputs of a picture: it is drawn again only when one of them changed visibly.
struct Key {
    what: What,
    tip: [f64; 3],
    /// Places along the needle and the second hand's tool, from [`moving_points`].
    needle: Vec<[f64; 3]>,
    force: [f64; 3],
    seeds: Vec<[f64; 3]>,
}

impl Key {
    fn looks_as(&self, drawn: &Self) -> bool {
        let near = |a: &[f64; 3], b: &[f64; 3], seen: f64| (0..3).all(|axis| (a[axis] - b[axis]).abs() <= seen);
        self.what == drawn.what
            && near(&self.tip, &drawn.tip, SEEN_M)
            && near(&self.force, &drawn.force, SEEN_N)
            && self.needle.len() == drawn.needle.len()
            && self.needle.iter().zip(&drawn.needle).all(|(a, b)| near(a, b, SEEN_M))
            && self.seeds.len() == drawn.seeds.len()
            && self.seeds.iter().zip(&drawn.seeds).all(|(a, b)| near(a, b, SEEN_M))
    }
}

#[derive(Clone, PartialEq)]
struct What {
    camera: Camera,
    look: Look,
    view: ViewState,
    scene: SceneId,
    changes: u64,
    /// Revisions of the present needle, and of the plan.
    plan: (u64, u64, usize),
    dose: u64,
    dark: bool,
}

/// Scene, plans, template shown, dark colours.
type PlanMarksKey = (SceneId, (u64, u64, usize), bool, bool);

#[derive(Default)]
pub struct Scene3d {
    gpu: Option<SceneGpu>,
    pub camera: Camera,
    pub look: Look,
    /// Scene of the surface on the card.
    uploaded_scene: Option<SceneId>,
    surface: Surface,
    /// Number of the body's motion on the card.
    moved: u64,
    /// Number of changes on the card.
    changes: u64,
    /// Dose on the card.
    shells: u64,
    drawn: Option<Key>,
    /// Inputs of the plan's marks.
    fixed: Option<PlanMarksKey>,
    marks: Marks,
    /// Place of the axes.
    corner_m: Option<[f32; 3]>,
}

impl Scene3d {
    pub fn new(state: Option<RenderState>) -> Self {
        Self {
            gpu: state.as_ref().map(SceneGpu::new),
            ..Self::default()
        }
    }

    pub fn driver(&self) -> DriverCost {
        self.gpu.as_ref().map_or_else(DriverCost::default, |gpu| gpu.driver)
    }

    pub fn reset_view(&mut self, shown: &Shown) {
        if let Some(scene) = &shown.scene {
            let (low, high) = (scene.target_lower_m, scene.target_upper_m);
            let middle = [0, 1, 2].map(|a| (0.5 * (low[a] + high[a])) as f32);
            let radius = (0..3).map(|a| (0.5 * (high[a] - low[a])).powi(2)).sum::<f64>().sqrt() as f32;
            self.camera = Camera::looking_at(middle, radius);
        }
    }

    pub fn look_from(&mut self, viewpoint: Viewpoint, shown: &Shown) {
        self.reset_view(shown);
        let Some(scene) = &shown.scene else { return };
        let patient = scene_from_patient(scene);
        let along = |axis: Vector3<f64>| (patient * axis).map(|c| c as f32);
        match viewpoint {
            Viewpoint::Oblique => {}
            Viewpoint::Perineum => self.camera.look_along(along(Vector3::z())),
            Viewpoint::Side => self.camera.look_along(along(Vector3::x())),
            Viewpoint::Above => self.camera.look_along(along(-Vector3::y())),
            Viewpoint::Needle => {
                if let (Some(tip), Some(state)) = (shown.tip_m(), &shown.state) {
                    self.camera.target_m = tip.map(|c| c as f32);
                    self.camera.distance_m = NEEDLE_VIEW_M;
                    self.camera.look_along(state.needle_direction.map(|c| c as f32).into());
                }
            }
        }
    }

    pub fn take(&mut self, shown: &Shown, body: &ShownBody) {
        let (Some(model), Some(bodies)) = (&body.model, body.bodies()) else {
            return;
        };
        let scene_key = model.header.id();
        if self.uploaded_scene != Some(scene_key) {
            self.uploaded_scene = Some(scene_key);
            self.drawn = None;
            self.reset_view(shown);
            self.surface = Surface::new(&bodies.rest_m, &bodies.triangles);
            if let Some(gpu) = &mut self.gpu {
                gpu.set_scene(self.surface.vertices(), &surfaces(bodies));
                gpu.set_surface(self.surface.vertices());
            }
        }
        if self.moved == body.moved {
            return;
        }
        self.moved = body.moved;
        let runs = self.surface.move_to(&body.positions_m);
        self.changes += u64::from(!runs.is_empty());
        if let Some(gpu) = self.gpu.as_mut().filter(|_| !runs.is_empty()) {
            gpu.move_surface(self.surface.vertices(), runs);
        }
    }

    pub fn scene3d_ui(
        &mut self,
        ui: &mut egui::Ui,
        rect: Rect,
        (shown, dose, body): (&Shown, Option<&Arc<DoseResult>>, &ShownBody),
        view: &mut ViewState,
    ) {
        let tokens = theme::of(ui);
        let response = ui.interact(rect, ui.scope_id().with("scene3d"), Sense::click_and_drag());
        theme::named(
            &response,
            egui::accesskit::Role::Image,
            || "View of gland, needle and seeds",
        );
        self.steer(ui, &response, rect, (body, view));
        let dose = dose.filter(|_| view.isodose);
        let painter = ui.painter_at(rect);
        match self.render(ui.ctx().pixels_per_point(), rect, (shown, dose, view), tokens) {
            Some(picture) => {
                picture.paint(&painter, rect);
                let legend = Legend {
                    painter: &painter,
                    rect,
                    camera: &self.camera,
                    tokens,
                    shown,
                };
                // Next to the slices, these show the levels already.
                let alone = dose.filter(|_| rect.width() > ALONE);
                let rows = legend.listed(self.look, alone.map(|d| &**d));
                legend.landmarks(self.corner_m, view, &rows);
                legend.scale_bar();
                legend.rows(&rows);
            }
            None => {
                let text = "No 3D view: the window has no wgpu device. Install a Vulkan driver (mesa-vulkan-drivers) and start again; everything else \
                            works.";
                reason(&painter, rect, text, (tokens.background, tokens.weak));
            }
        }
    }

    fn steer(
        &mut self,
        ui: &egui::Ui,
        response: &egui::Response,
        rect: Rect,
        (body, view): (&ShownBody, &mut ViewState),
    ) {
        let drag = response.drag_delta();
        if response.dragged_by(PointerButton::Primary) {
            self.camera
                .orbit([-drag.x * TURN_PER_POINT_RAD, drag.y * TURN_PER_POINT_RAD]);
        } else if response.dragged_by(PointerButton::Secondary) || response.dragged_by(PointerButton::Middle) {
            let height = rect.height().max(1.0);
            self.camera.pan([drag.x / height, drag.y / height]);
        }
        if response.hovered() {
            let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            self.camera.zoom(((scroll * 0.003).exp() * pinch).clamp(0.2, 5.0));
        }
        if response.clicked()
            && view.measure.active
            && let (Some(place), Some(bodies)) = (response.interact_pointer_pos(), body.bodies())
        {
            let at = (place - rect.min) / rect.size();
            let ray = self.camera.ray(rect.aspect_ratio(), [at.x, at.y]);
            if let Some(met) = pick(self.surface.vertices(), &bodies.triangles, self.camera.eye_m(), ray) {
                view.measure.take(met.map(f64::from));
            }
        }
    }

    fn render(
        &mut self,
        scale: f32,
        rect: Rect,
        (shown, dose, view): (&Shown, Option<&Arc<DoseResult>>, &ViewState),
        tokens: &'static Tokens,
    ) -> Option<Pasted> {
        let gpu = self.gpu.as_mut()?;
        let pixels = [rect.width() * scale, rect.height() * scale].map(|side| side.round().max(1.0) as u32);
        let fresh = gpu.resize(pixels);
        let number = dose.map_or(0, |d| d.number);
        if self.shells != number {
            self.shells = number;
            gpu.set_shells(dose.map_or(&[], |d| &d.shells));
        }
        let what = What {
            camera: self.camera,
            look: self.look,
            view: view.clone(),
            scene: self.uploaded_scene.unwrap_or_default(),
            changes: self.changes,
            plan: (
                shown.plan.map_or(0, |p| p.generation),
                shown.planning.implant.as_ref().map_or(0, |i| i.revision),
                shown.planning.progress.begun(),
            ),
            dose: number,
            dark: tokens.dark,
        };
        let key = Key {
            what,
            tip: shown.tip_m().unwrap_or_default(),
            needle: moving_points(shown),
            force: shown.state.map_or([0.0; 3], |s| s.force_on_hand_n),
            seeds: shown.seeds.iter().map(|s| shown.drawn_at_m(s)).collect(),
        };
        let moves = !fresh && !self.drawn.as_ref().is_some_and(|drawn| key.looks_as(drawn));
        if fresh || moves || gpu.shows_coarse() {
            let fixed = (key.what.scene, key.what.plan, key.what.look.template, key.what.dark);
            if self.fixed != Some(fixed) {
                self.fixed = Some(fixed);
                self.corner_m = collect_fixed(&mut self.marks, shown, self.look, tokens);
                gpu.set_marks(0, &self.marks);
            }
            collect_live(&mut self.marks, (shown, view), self.look, tokens);
            gpu.set_marks(1, &self.marks);
            let whole = uniform(&self.camera, rect.aspect_ratio());
            let cut = section(&self.camera, view, shown);
            let tinted = |color, opacity, section| tint(whole, color, opacity, section);
            let opacity = 1.0 - self.look.transparency;
            let looks: Vec<SceneUniform> = kinds(shown.scene.as_ref())
                .map(|kind| tinted(kind.color(tokens), opacity * kind.share(), cut))
                .collect();
            let shift_m = dose.map_or([0.0; 3], |d| d.shift_m(shown.body_moved_m));
            let shells: Vec<SceneUniform> = dose
                .iter()
                .flat_map(|d| &d.shells)
                .map(|shell| shifted(tinted(IMAGE.isodose[shell.level], SHELL, cut), shift_m))
                .collect();
            let ghost = tinted(tokens.ghost, 0.22, [0.0; 4]);
            let clear = theme::rgba(tokens.background, 1.0);
            let clear = [clear[0], clear[1], clear[2]].map(f64::from);
            gpu.draw(&looks, &shells, self.look.rest_shape.then_some(&ghost), (clear, moves));
            self.drawn = Some(key);
        }
        gpu.picture()
    }
}
