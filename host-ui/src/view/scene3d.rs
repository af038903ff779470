//! The picture in the middle: what it shows, how the pointer turns it, and the words drawn over it.

use super::camera::Camera;
use super::gpu::{Gpu, SceneUniform};
use super::marks::Marks;
use super::mesh::{self, SurfaceVertex};
use crate::link::{SceneModel, Snapshot};
use crate::panel::Shown;
use crate::{format, theme};
use eframe::egui_wgpu::RenderState;
use egui::{Align2, Color32, FontId, PointerButton, Pos2, Rect, Sense, Stroke, Vec2};
use std::sync::Arc;
use stylet_shm_schema::{SceneHeader, StructureInfo, role};

const TURN_PER_POINT_RAD: f32 = 0.008;
const LIGHT: [f32; 4] = [-0.48, 0.78, -0.40, 0.0];

/// What a person set; the same settings and the same data give the same picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// 0 opaque, 1 not to be seen.
    pub transparency: f32,
    pub rest_shape: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            transparency: 0.55,
            rest_shape: false,
        }
    }
}

/// Everything a picture depends on: drawn again only when one of them changed.
#[derive(Clone, Copy, PartialEq)]
struct Key {
    camera: Camera,
    look: Look,
    scene: (u64, u64),
    snapshot: (u64, u64),
    plan: u64,
    tip: [f64; 3],
    seed_count: usize,
}

pub struct Scene3d {
    gpu: Option<Gpu>,
    pub camera: Camera,
    pub look: Look,
    /// Session and generation of the surface that the card has.
    uploaded_scene: Option<(u64, u64)>,
    uploaded_snapshot: Option<(u64, u64)>,
    drawn: Option<Key>,
    marks: Marks,
    /// Where the axes are drawn.
    corner_m: Option<[f32; 3]>,
    vertices: Vec<SurfaceVertex>,
}

impl Scene3d {
    pub fn new(state: Option<RenderState>) -> Self {
        Self {
            gpu: state.map(Gpu::new),
            camera: Camera::default(),
            look: Look::default(),
            uploaded_scene: None,
            uploaded_snapshot: None,
            drawn: None,
            marks: Marks::default(),
            corner_m: None,
            vertices: Vec::new(),
        }
    }

    pub fn reset_view(&mut self, shown: &Shown) {
        self.camera = match &shown.scene {
            None => Camera::default(),
            Some(scene) => {
                let middle = [0, 1, 2].map(|i| (0.5 * (scene.lower_m[i] + scene.upper_m[i])) as f32);
                let size = [0, 1, 2].map(|i| (scene.upper_m[i] - scene.lower_m[i]) as f32);
                let radius = 0.5 * size.iter().map(|s| s * s).sum::<f32>().sqrt();
                Camera::looking_at(middle, radius.clamp(5e-3, 1.0))
            }
        };
    }

    /// Hands to the card what is new since the last frame, and nothing else.
    pub fn take(&mut self, shown: &Shown, model: Option<&Arc<SceneModel>>, snapshot: Option<&Snapshot>) {
        let Some(model) = model else { return };
        let scene_key = (model.header.session_id, model.header.generation);
        if self.uploaded_scene != Some(scene_key) {
            self.uploaded_scene = Some(scene_key);
            self.uploaded_snapshot = None;
            self.drawn = None;
            self.reset_view(shown);
            mesh::surface(&model.rest_m, &model.triangles, &mut self.vertices);
            if let Some(gpu) = &mut self.gpu {
                gpu.set_scene(&self.vertices, &surfaces(model));
                gpu.set_surface(&self.vertices);
            }
        }
        let Some(snapshot) = snapshot else { return };
        let snapshot_key = (snapshot.header.session_id, snapshot.header.tissue_tick);
        if self.uploaded_snapshot != Some(snapshot_key) && snapshot.positions_m.len() == model.rest_m.len() {
            self.uploaded_snapshot = Some(snapshot_key);
            mesh::surface(&snapshot.positions_m, &model.triangles, &mut self.vertices);
            if let Some(gpu) = &mut self.gpu {
                gpu.set_surface(&self.vertices);
            }
        }
    }

    pub fn scene3d_ui(&mut self, ui: &mut egui::Ui, shown: &Shown) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::accesskit::Role::Image, true, "View of gland, needle and seeds")
        });
        self.steer(ui, &response, rect);
        let aspect = rect.width() / rect.height().max(1.0);
        match self.render(ui.ctx().pixels_per_point(), rect, aspect, shown) {
            Some(texture) => {
                let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
                ui.painter().image(texture, rect, whole, Color32::WHITE);
                self.words(ui, rect, aspect, shown);
            }
            None => {
                let text = "No 3D view: the window has no wgpu device.\nInstall a Vulkan driver (mesa-vulkan-drivers) and start again; everything else works.";
                let font = FontId::proportional(15.0);
                ui.painter()
                    .text(rect.center(), Align2::CENTER_CENTER, text, font, theme::WEAK);
            }
        }
        self.controls(ui, rect, shown);
    }

    fn steer(&mut self, ui: &egui::Ui, response: &egui::Response, rect: Rect) {
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
    }

    fn render(&mut self, scale: f32, rect: Rect, aspect: f32, shown: &Shown) -> Option<egui::TextureId> {
        let gpu = self.gpu.as_mut()?;
        let pixels = [rect.width() * scale, rect.height() * scale].map(|side| side.round().max(1.0) as u32);
        let fresh = gpu.resize(pixels);
        let key = Key {
            camera: self.camera,
            look: self.look,
            scene: self.uploaded_scene.unwrap_or_default(),
            snapshot: self.uploaded_snapshot.unwrap_or_default(),
            plan: shown.plan.map_or(0, |p| p.generation),
            tip: shown.tip_m().unwrap_or_default(),
            seed_count: shown.seeds.len(),
        };
        if fresh || self.drawn != Some(key) {
            self.corner_m = collect(&mut self.marks, shown);
            gpu.set_marks(&self.marks);
            let opacity = 1.0 - self.look.transparency;
            let looks: Vec<SceneUniform> = kinds(shown.scene.as_ref())
                .map(|kind| uniform(&self.camera, aspect, kind.color(), opacity * kind.share()))
                .collect();
            let ghost = uniform(&self.camera, aspect, theme::GHOST, 0.22);
            let clear = theme::rgba(theme::BACKGROUND, 1.0);
            let clear = [clear[0], clear[1], clear[2]].map(f64::from);
            gpu.draw(&looks, self.look.rest_shape.then_some(&ghost), clear);
            self.drawn = Some(key);
        }
        gpu.texture()
    }

    /// Names of axes and landmarks, the bar that gives the scale, and what each shape means.
    fn words(&self, ui: &egui::Ui, rect: Rect, aspect: f32, shown: &Shown) {
        let painter = ui.painter_at(rect);
        let at = |place_m: [f32; 3]| {
            let [x, y] = self.camera.project(aspect, place_m)?;
            Some(rect.min + Vec2::new(x * rect.width(), y * rect.height()))
        };
        let font = FontId::proportional(12.0);
        if let Some(corner) = self.corner_m {
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                let mut end = corner;
                end[axis] += 0.0145;
                if let Some(place) = at(end) {
                    painter.text(place, Align2::CENTER_CENTER, name, font.clone(), theme::WEAK);
                }
            }
        }
        if let Some(plan) = &shown.plan {
            let entry = plan.entry_m.map(|c| c as f32);
            if let Some(place) = at(entry) {
                let place = place + Vec2::new(0.0, -16.0);
                painter.text(place, Align2::CENTER_BOTTOM, "entry", font.clone(), theme::ENTRY);
            }
        }
        scale_bar(&painter, rect, self.camera.height_at_target_m());
        legend(&painter, rect, shown, self.look);
    }

    /// The few settings of the picture, over its upper edge.
    fn controls(&mut self, ui: &mut egui::Ui, rect: Rect, shown: &Shown) {
        let bar = Rect::from_min_size(rect.min + Vec2::splat(8.0), Vec2::new(rect.width() - 16.0, 28.0));
        ui.scope_builder(egui::UiBuilder::new().max_rect(bar), |ui| {
            ui.horizontal(|ui| {
                if ui.button("Reset view").on_hover_text("Key R").clicked() {
                    self.reset_view(shown);
                }
                let label = ui.label(theme::weak("Transparency"));
                let mut percent = self.look.transparency * 100.0;
                let slider = egui::Slider::new(&mut percent, 0.0..=100.0)
                    .suffix(" %")
                    .fixed_decimals(0);
                if ui.add(slider).labelled_by(label.id).changed() {
                    self.look.transparency = percent / 100.0;
                }
                ui.checkbox(&mut self.look.rest_shape, "Rest shape")
                    .on_hover_text("Shows where the gland was before the needle moved it");
            });
        });
    }
}

/// What a surface is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// The body around the others.
    Body,
    Gland,
    Spared,
    Bone,
}

impl Kind {
    fn color(self) -> Color32 {
        match self {
            Self::Body => theme::BODY,
            Self::Gland => theme::GLAND,
            Self::Spared => theme::SPARED,
            Self::Bone => theme::BONE,
        }
    }

    /// Of the opacity that a person set: what lies around the gland must not hide it.
    fn share(self) -> f32 {
        match self {
            Self::Body => 0.16,
            Self::Gland => 1.0,
            Self::Spared => 0.5,
            Self::Bone => 0.6,
        }
    }
}

/// Structures that are drawn by themselves.
fn drawn(scene: &SceneHeader) -> impl Iterator<Item = &StructureInfo> {
    scene.structures().iter().filter(|s| s.triangle_count > 0)
}

/// What each surface is of, the body's first. A body without others in it is the gland.
fn kinds(scene: Option<&SceneHeader>) -> impl Iterator<Item = Kind> {
    let inner = scene.into_iter().flat_map(drawn).map(|s| match s.role {
        bits if bits & role::TARGET != 0 => Kind::Gland,
        bits if bits & role::FIXED != 0 => Kind::Bone,
        _ => Kind::Spared,
    });
    let body = if scene.is_some_and(|s| drawn(s).next().is_some()) {
        Kind::Body
    } else {
        Kind::Gland
    };
    std::iter::once(body).chain(inner)
}

/// The indices of each surface, in the order of [`kinds`].
fn surfaces(model: &SceneModel) -> Vec<Vec<u32>> {
    let header = &model.header;
    let inner = drawn(header).map(|s| (s.first_triangle as usize, s.triangle_count as usize));
    std::iter::once((0, header.body_triangle_count as usize))
        .chain(inner)
        .map(|(first, count)| {
            let triangles = model.triangles.get(first..first + count).unwrap_or(&[]);
            mesh::indices(triangles, model.rest_m.len())
        })
        .collect()
}

fn uniform(camera: &Camera, aspect: f32, color: Color32, opacity: f32) -> SceneUniform {
    let eye = camera.eye_m();
    let length = LIGHT.iter().map(|c| c * c).sum::<f32>().sqrt();
    SceneUniform {
        clip_from_scene: camera.clip_from_scene(aspect).into(),
        eye_m: [eye.x, eye.y, eye.z, 1.0],
        light: LIGHT.map(|c| c / length),
        surface: theme::rgba(color, opacity),
        look: [1.0, 0.25 * (1.0 - opacity), 0.0, 0.0],
    }
}

fn collect(marks: &mut Marks, shown: &Shown) -> Option<[f32; 3]> {
    marks.clear();
    let corner = shown.scene.map(|scene| marks.ground(scene.lower_m, scene.upper_m));
    if let (Some(tip), Some(state)) = (shown.tip_m(), &shown.state) {
        marks.needle(tip, state.needle_direction);
    }
    for seed in &shown.seeds {
        marks.placed_seed(seed.position_m, seed.axis);
    }
    if let Some(plan) = &shown.plan {
        marks.entry(plan.entry_m, plan.direction);
        for seed in shown.planned() {
            marks.planned_seed(seed.position_m, plan.direction);
        }
        if let Some(end) = shown.path_end_m() {
            marks.path(plan.entry_m, end);
        }
    }
    corner
}

fn scale_bar(painter: &egui::Painter, rect: Rect, height_m: f32) {
    let points_per_mm = rect.height() / (format::mm(f64::from(height_m)) as f32).max(1e-6);
    let length_mm = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0]
        .into_iter()
        .find(|mm| mm * points_per_mm >= 60.0)
        .unwrap_or(500.0_f32);
    let end = rect.right_bottom() - Vec2::new(16.0, 16.0);
    let start = end - Vec2::new(length_mm * points_per_mm, 0.0);
    let stroke = Stroke::new(2.0, theme::PATH);
    painter.line_segment([start, end], stroke);
    for place in [start, end] {
        painter.line_segment([place - Vec2::new(0.0, 4.0), place + Vec2::new(0.0, 4.0)], stroke);
    }
    let text = format!("{length_mm:.0} mm");
    let middle = start + (end - start) * 0.5 - Vec2::new(0.0, 6.0);
    painter.text(
        middle,
        Align2::CENTER_BOTTOM,
        text,
        FontId::proportional(12.0),
        theme::PATH,
    );
}

fn legend(painter: &egui::Painter, rect: Rect, shown: &Shown, look: Look) {
    let mut rows: Vec<(&str, Color32, bool)> = Vec::new();
    if let Some(scene) = &shown.scene {
        rows.push(("gland", theme::GLAND, true));
        let others: Vec<Kind> = kinds(Some(scene)).collect();
        for (kind, name) in [
            (Kind::Spared, "to be spared"),
            (Kind::Bone, "bone"),
            (Kind::Body, "body"),
        ] {
            if others.contains(&kind) {
                rows.push((name, kind.color(), true));
            }
        }
    }
    if look.rest_shape {
        rows.push(("gland at rest", theme::GHOST, true));
    }
    if shown.plan.is_some() {
        rows.push(("planned seed", theme::SEED_PLANNED, false));
    }
    if !shown.seeds.is_empty() {
        rows.push(("placed seed", theme::SEED_PLACED, true));
    }
    let mut place = rect.left_bottom() + Vec2::new(18.0, -16.0);
    for (name, color, filled) in rows.into_iter().rev() {
        if filled {
            painter.circle_filled(place, 5.0, color);
        } else {
            painter.circle_stroke(place, 4.5, Stroke::new(1.5, color));
        }
        let text = place + Vec2::new(12.0, 0.0);
        painter.text(text, Align2::LEFT_CENTER, name, FontId::proportional(12.0), theme::WEAK);
        place.y -= 18.0;
    }
}
