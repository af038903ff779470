//! The middle of the window: the three-dimensional picture, the slices, and the tools over them.

use super::body::ShownBody;
use super::draw::Drawing;
use super::driver::DriverCost;
use super::fluoro::FluoroView;
use super::orientation::Orientation;
use super::probe::{ProbePicture, ProbeView};
use super::scene3d::Scene3d;
use super::slice::{ImageError, Plane, Slices};
use super::state::{Tool, ViewState};
use crate::IN_PAGE;
use crate::action::{Action, Viewpoint};
use crate::dose_worker::DoseResult;
use crate::settings::Layout;
use crate::shown::Shown;
use crate::theme;
use crate::theme::Press;
use eframe::egui_wgpu::RenderState;
use egui::{Pos2, Rect};
use std::sync::Arc;
use stylet_files::Image;
use stylet_host::link::{SceneModel, Snapshot};
use stylet_imaging::fluoroscopy::DoseCounter;
use stylet_imaging::ultrasound::View;
use stylet_shm_schema::SceneHeader;

/// Gap between two pictures.
const GAP: f32 = 2.0;
/// Share of the height for the screen of the C-arm.
const FLUORO_SHARE: f32 = 0.6;

/// Three-dimensional picture and slices.
pub struct Middle {
    /// Three-dimensional picture.
    pub(crate) solid: Scene3d,
    slices: Slices,
    probe: ProbeView,
    /// Drawing in each plane of the probe.
    drawings: [Drawing; 2],
    fluoro: FluoroView,
    body: ShownBody,
    /// State common to all pictures.
    pub(crate) view: ViewState,
    /// Top of the pictures, under the tools, in the last frame.
    pictures_top: f32,
}

/// Places of the pictures.
struct Places {
    solid: Option<Rect>,
    slices: Vec<(Orientation, Rect)>,
    probe: Vec<(View, Rect)>,
    fluoro: Option<Rect>,
}

impl Middle {
    /// Creates pictures on this graphics device; without one they are empty.
    pub(crate) fn new(state: Option<RenderState>) -> Self {
        Self {
            solid: Scene3d::new(state.clone()),
            slices: Slices::new(state.clone()),
            probe: ProbeView::new(state.clone()),
            drawings: Default::default(),
            fluoro: FluoroView::new(state),
            body: ShownBody::default(),
            view: ViewState::default(),
            pictures_top: 0.0,
        }
    }

    /// Returns the top of the pictures.
    pub(crate) fn pictures_top(&self) -> f32 {
        self.pictures_top
    }

    /// Returns the number of bytes sent to the graphics card since the window opened.
    pub(crate) fn driver(&self) -> DriverCost {
        self.solid.driver().plus(self.slices.driver())
    }

    /// Takes the data that arrived since the last frame.
    pub(crate) fn take(&mut self, shown: &Shown, model: Option<&Arc<SceneModel>>, snapshot: Option<&Snapshot>) {
        self.body.take(model, snapshot);
        self.solid.take(shown, &self.body);
        self.slices.take(&self.body, &mut self.view);
        if let (true, Some(tip_m), Some(scene)) = (self.view.follow_tip, shown.tip_m(), &shown.scene) {
            // A needle at its entry is in two of the planes; the third waits for it at the edge of the body.
            for (axis, place_m) in tip_m.into_iter().enumerate() {
                if near_body(scene, axis).contains(&place_m) {
                    self.view.cursor_m[axis] = place_m;
                }
            }
        }
    }

    /// Returns the plane that a slice at this place of the window shows.
    pub fn plane(&self, orientation: Orientation, rect: Rect) -> Plane {
        self.slices.plane(orientation, &self.view, rect)
    }

    /// Returns a picture of the probe as it stood in the window in the last frame; `None` if the
    /// layout has none.
    pub fn probe_picture(&self, view: View) -> Option<&ProbePicture> {
        self.probe.picture(view)
    }

    /// Returns the place of the transverse plane along the probe's axis, m.
    pub(crate) fn transverse_at_m(&self, shown: &Shown) -> Option<f64> {
        let (frame, picture) = (shown.planning.review.frame?, self.probe.picture(View::Transverse)?);
        Some(frame.in_plane_m(picture.plane.pose.middle_m).1)
    }

    /// Returns the dose that fluoroscopy has cost this patient.
    pub fn spent(&self) -> DoseCounter {
        self.fluoro.dose
    }

    /// Shows an image in the slices, of the patient of the scene with this name.
    pub(crate) fn show_image(&mut self, image: Image, scene: &str) -> Result<(), ImageError> {
        self.view.image = true;
        self.slices.show_image(image, scene)
    }

    /// Shows all of the target again.
    pub(crate) fn reset_view(&mut self, shown: &Shown) {
        self.solid.reset_view(shown);
        self.slices.reset_view(shown);
    }

    /// Draws the tools and the pictures of the layout.
    pub(crate) fn middle_ui(
        &mut self,
        ui: &mut egui::Ui,
        layout: Layout,
        shown: &Shown,
        dose: Option<&Arc<DoseResult>>,
    ) -> Vec<Action> {
        let mut actions = Vec::new();
        let tokens = theme::of(ui);
        let tools = egui::Frame::new()
            .fill(tokens.panel)
            .inner_margin(egui::Margin::symmetric(8, 4));
        let spacing = std::mem::take(&mut ui.spacing_mut().item_spacing);
        tools.show(ui, |ui| {
            ui.spacing_mut().item_spacing = spacing;
            ui.set_min_width(ui.available_width());
            // A tool without room begins a row and is not narrowed.
            ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
            ui.horizontal_wrapped(|ui| self.tools_ui(ui, layout, shown, &mut actions));
        });
        let rect = ui.available_rect_before_wrap();
        ui.advance_cursor_after_rect(rect);
        self.pictures_top = rect.top();
        let places = places(rect, layout);
        if layout != Layout::Solid {
            // Only the visible gaps between the pictures: for a software driver each layer of a
            // pixel costs as much as the last.
            let whole = Rect::from_center_size(meet(rect, layout), egui::Vec2::splat(GAP));
            for strip in [
                Rect::from_x_y_ranges(rect.x_range(), whole.y_range()),
                Rect::from_x_y_ranges(whole.x_range(), rect.y_range()),
            ] {
                ui.painter().rect_filled(strip, 0.0, tokens.background);
            }
        }
        for (orientation, rect) in places.slices {
            actions.extend(
                self.slices
                    .slice_ui(ui, rect, orientation, (shown, dose, &self.body), &mut self.view),
            );
        }
        self.probe.forget_pictures();
        for (view, rect) in places.probe {
            let seen = (shown, &self.body, &self.body.field);
            actions.extend(self.probe.picture_ui(ui, rect, view, seen));
            if let Some(picture) = self.probe.picture(view).filter(|_| layout == Layout::Probe) {
                let (tool, review) = (self.view.tool, &shown.planning.review);
                actions.extend(self.drawings[view as usize].draw_ui(ui, picture, tool, review));
            }
        }
        match places.fluoro {
            Some(rect) => {
                let seen = (shown, &self.body, &self.body.field);
                self.fluoro.picture_ui(ui, rect, seen);
            }
            None => self.fluoro.release(),
        }
        if let Some(rect) = places.solid {
            self.solid
                .scene3d_ui(ui, rect, (shown, dose, &self.body), &mut self.view);
        }
        actions
    }

    fn tools_ui(&mut self, ui: &mut egui::Ui, layout: Layout, shown: &Shown, actions: &mut Vec<Action>) {
        for &one in Layout::offered() {
            if ui
                .selectable_label(layout == one, one.name())
                .on_hover_text("Key V")
                .clicked()
            {
                actions.push(Action::SetLayout(one));
            }
        }
        if layout == Layout::Probe {
            ui.separator();
            actions.extend(self.probe.tools_ui(ui, shown));
            let mut draws = self.view.tool.is_some();
            let toggle = ui.toggle_value(&mut draws, "Update plan");
            let hint = "Contour the gland and mark seeds on the live picture, and replan the remaining needles";
            if toggle.on_hover_text(hint).clicked() {
                self.view.tool = draws.then_some(Tool::Contour);
            }
        }
        if layout == Layout::Fluoroscopy {
            ui.separator();
            self.fluoro.tools_ui(ui);
        }
        ui.separator();
        ui.toggle_value(&mut self.view.follow_tip, "Follow tip")
            .on_hover_text("Key F: the slices go through the tip of the needle");
        let mut measuring = self.view.measure.active;
        let measure = ui.toggle_value(&mut measuring, "Measure");
        if measure
            .on_hover_text("Key M: the distance between two clicks in any picture")
            .clicked()
        {
            actions.push(Action::ToggleMeasure);
        }
        ui.toggle_value(&mut self.view.isodose, "Isodose").on_hover_text(
            "Key I: 50, 100, 150 and 200 % of the prescription, from the seeds at their present positions",
        );
        if let Some(name) = self.slices.image_name() {
            ui.toggle_value(&mut self.view.image, "Image")
                .on_hover_text(format!("Key G: {name} in the slices, or simulated ultrasound"));
        }
        ui.menu_button("3D view", |ui| self.solid_menu(ui, shown, actions));
        // A page saves no files.
        let pressed = !IN_PAGE && Press("Picture", "F12: saves the window as PNG").ui(ui, true);
        actions.extend(pressed.then_some(Action::SavePicture));
    }

    fn solid_menu(&mut self, ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
        let pressed = Press("Reset view", "Key R").ui(ui, true);
        actions.extend(pressed.then_some(Action::ResetView));
        for (number, preset) in Viewpoint::ALL.into_iter().enumerate() {
            let text = format!("{}  {}", number + 1, preset.name());
            if ui.button(text).clicked() {
                self.solid.look_from(preset, shown);
            }
        }
        ui.separator();
        let look = &mut self.solid.look;
        let label = ui.label(theme::weak("Transparency"));
        let mut percent = look.transparency * 100.0;
        let slider = egui::Slider::new(&mut percent, 0.0..=100.0)
            .suffix(" %")
            .fixed_decimals(0);
        if ui.add(slider).labelled_by(label.id).changed() {
            look.transparency = percent / 100.0;
        }
        ui.checkbox(&mut look.rest_shape, "Rest shape")
            .on_hover_text("Shows the gland before the needle moved it");
        ui.checkbox(&mut look.force, "Force on the hand");
        ui.checkbox(&mut look.template, "Template")
            .on_hover_text("13 by 13 holes, 5 mm apart, about the planned path");
        ui.separator();
        ui.label(theme::weak("Cut away"));
        ui.radio_value(&mut self.view.section, None, "Nothing");
        for orientation in Orientation::ALL {
            let text = format!("At the {} slice", orientation.name().to_lowercase());
            ui.radio_value(&mut self.view.section, Some(orientation), text);
        }
    }
}

/// Returns the extent of the body along an axis, with a little more.
fn near_body(scene: &SceneHeader, axis: usize) -> std::ops::RangeInclusive<f64> {
    const NEAR_M: f64 = 0.002;
    scene.lower_m[axis] - NEAR_M..=scene.upper_m[axis] + NEAR_M
}

/// Returns the point where the pictures of a layout meet.
fn meet(rect: Rect, layout: Layout) -> Pos2 {
    match layout {
        Layout::Fluoroscopy => Pos2::new(rect.center().x, (rect.top() + FLUORO_SHARE * rect.height()).round()),
        _ => rect.center(),
    }
}

fn places(rect: Rect, layout: Layout) -> Places {
    let [axial, sagittal, coronal] = Orientation::ALL;
    let middle = meet(rect, layout);
    let cell = |column: usize, row: usize| {
        let (x, y) = (rect.x_range(), rect.y_range());
        let half = GAP / 2.0;
        let [left, right] = [[x.min, middle.x - half], [middle.x + half, x.max]][column];
        let [top, bottom] = [[y.min, middle.y - half], [middle.y + half, y.max]][row];
        Rect::from_min_max(Pos2::new(left, top), Pos2::new(right, bottom))
    };
    let (mut solid, mut slices, mut probe, mut fluoro) = (None, Vec::new(), Vec::new(), None);
    match layout {
        Layout::Quad => {
            solid = Some(cell(1, 0));
            slices = vec![(axial, cell(0, 0)), (sagittal, cell(0, 1)), (coronal, cell(1, 1))];
        }
        Layout::Solid => solid = Some(rect),
        Layout::Slices => {
            // The sagittal slice shows most of an insertion and gets the lower half.
            let lower = cell(0, 1).union(cell(1, 1));
            slices = vec![(axial, cell(0, 0)), (coronal, cell(1, 0)), (sagittal, lower)];
        }
        Layout::Probe => {
            solid = Some(cell(1, 0));
            slices = vec![(coronal, cell(1, 1))];
            probe = vec![(View::Transverse, cell(0, 0)), (View::Sagittal, cell(0, 1))];
        }
        Layout::Fluoroscopy => {
            solid = Some(cell(1, 1));
            probe = vec![(View::Transverse, cell(0, 1))];
            fluoro = Some(cell(0, 0).union(cell(1, 0)));
        }
    }
    Places {
        solid,
        slices,
        probe,
        fluoro,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::Vec2;

    #[test]
    fn pictures_lie_in_the_window_and_not_over_each_other() {
        let rect = Rect::from_min_size(Pos2::new(286.0, 70.0), Vec2::new(664.0, 730.0));
        for layout in Layout::ALL {
            let places = places(rect, layout);
            let slices = places.slices.iter().map(|(_, r)| *r);
            let probe = places.probe.iter().map(|(_, r)| *r);
            let all: Vec<Rect> = slices.chain(probe).chain(places.solid).chain(places.fluoro).collect();
            for (i, a) in all.iter().enumerate() {
                assert!(rect.contains_rect(*a), "{layout:?}");
                assert!(all[i + 1..].iter().all(|b| !a.intersects(*b)), "{layout:?}");
                assert!(a.width() > 200.0 && a.height() > 200.0, "{layout:?}: {a:?}");
            }
        }
    }
}
