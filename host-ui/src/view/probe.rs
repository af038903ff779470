//! What the ultrasound probe sees: both of its planes, with the template's grid over the one across it.

use super::body::ShownBody;
use super::paste::{Paste, Pasted};
use super::slice::{ROOM_FOR_REASON, words};
use crate::shown::Shown;
use crate::theme::IMAGE;
use eframe::egui_wgpu::RenderState;
use egui::{Align2, FontId, Key, Pos2, Rect, Sense, Vec2};
use nalgebra::Vector3;
use stylet_base::format;
use stylet_imaging::ultrasound::{Plane, Pose, Probe, Scanner, Settings, View};
use stylet_imaging::{Body, Gpu, Metal};
use stylet_implant::plan::{Hole, Template};
use stylet_shm_schema::SceneId;
use stylet_surfaces::field::Field;

/// A step of the stepper, mm.
const STEP_MM: f64 = 5.0;
/// Half the way of the stepper, mm.
const WAY_MM: f64 = 60.0;
const LARGEST_SIDE: u32 = 1024;

/// How the probe stands on its stepper, and the knobs of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Knobs {
    /// Into the patient from the middle of the target, mm.
    way_mm: f64,
    /// About its axis, degrees.
    turn_deg: f64,
    depth_mm: f64,
    gain_db: f64,
    template: bool,
}

/// The picture of one plane, and what it was drawn of.
struct Pane {
    scanner: Scanner,
    scene: Option<SceneId>,
    drawn: Option<(Plane, Settings, Metal, Field)>,
    pasted: Option<Pasted>,
}

/// Both planes of the probe.
pub(super) struct ProbeView {
    paste: Option<Paste>,
    panes: Vec<Pane>,
    knobs: Knobs,
    /// The frame in which a picture was computed last.
    computed_in: u64,
}

impl ProbeView {
    /// Without a graphics device that computes there are no pictures.
    pub fn new(state: Option<RenderState>) -> Self {
        let gpu = state.as_ref().map(|state| Gpu {
            device: state.device.clone(),
            queue: state.queue.clone(),
        });
        Self {
            paste: state
                .as_ref()
                .filter(|_| gpu.as_ref().is_some_and(Gpu::computes))
                .map(Paste::new),
            panes: gpu.filter(Gpu::computes).map_or_else(Vec::new, |gpu| {
                let pane = |_| Pane {
                    scanner: Scanner::new(gpu.clone()),
                    scene: None,
                    drawn: None,
                    pasted: None,
                };
                View::ALL.map(pane).into()
            }),
            knobs: Knobs {
                way_mm: 0.0,
                turn_deg: 0.0,
                depth_mm: 60.0,
                gain_db: 0.0,
                template: true,
            },
            computed_in: 0,
        }
    }

    /// Stepper and knobs.
    pub fn tools_ui(&mut self, ui: &mut egui::Ui) {
        let knobs = &mut self.knobs;
        if ui.memory(|m| m.focused().is_none()) {
            let pressed = |key| f64::from(u8::from(ui.input(|i| i.key_pressed(key))));
            knobs.way_mm += STEP_MM * (pressed(Key::PageUp) - pressed(Key::PageDown));
            knobs.way_mm = knobs.way_mm.clamp(-WAY_MM, WAY_MM);
        }
        let mut value = |name: &str, value: &mut f64, most: [f64; 2], unit: &str, hint: &str| {
            let label = ui.label(name);
            let drag = egui::DragValue::new(value)
                .range(most[0]..=most[1])
                .speed(0.5)
                .fixed_decimals(1)
                .suffix(unit);
            ui.add(drag).labelled_by(label.id).on_hover_text(hint);
        };
        let way = "Keys PgUp, PgDn: 5 mm. 0 is the middle of the target, positive into the patient";
        value("Way", &mut knobs.way_mm, [-WAY_MM, WAY_MM], " mm", way);
        value(
            "Turn",
            &mut knobs.turn_deg,
            [-90.0, 90.0],
            "°",
            "About the probe's axis",
        );
        value(
            "Depth",
            &mut knobs.depth_mm,
            [30.0, 100.0],
            " mm",
            "From the probe's surface",
        );
        value("Gain", &mut knobs.gain_db, [-30.0, 30.0], " dB", "Of the whole picture");
        ui.toggle_value(&mut knobs.template, "Grid")
            .on_hover_text("Holes of the template in the transverse picture");
    }

    /// Draws one plane.
    pub fn picture_ui(
        &mut self,
        ui: &mut egui::Ui,
        rect: Rect,
        view: View,
        (shown, body, field): (&Shown, &ShownBody, &Field),
    ) {
        let response = ui.interact(rect, ui.scope_id().with(view.name()), Sense::hover());
        let name = format!("{} ultrasound", view.name());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::accesskit::Role::Image, true, &name));
        let painter = ui.painter_at(rect);
        let Some(model) = body.model().filter(|_| shown.scene.is_some()) else {
            painter.rect_filled(rect, 0.0, IMAGE.background);
            words(&painter, rect, &format!("{name}: no scene yet"), IMAGE.text);
            return;
        };
        let scale = ui.ctx().pixels_per_point();
        let side = |points: f32| ((points * scale).round() as u32).clamp(16, LARGEST_SIDE);
        let knobs = self.knobs;
        let plane = Plane {
            pose: Pose::of_scene(&model.header).moved(knobs.way_mm * 1e-3, knobs.turn_deg.to_radians()),
            view,
            probe: Probe::default(),
            depth_m: knobs.depth_mm * 1e-3,
            pixels: [side(rect.width()), side(rect.height())],
        };
        let settings = Settings {
            gain_db: knobs.gain_db,
            ..Settings::default()
        };
        let metal = shown.metal();
        let pass = ui.ctx().cumulative_pass_nr();
        // One picture a frame, so that no frame waits for both.
        let may_compute = self.computed_in != pass;
        if let (Some(pane), Some(paste)) = (self.panes.get_mut(view as usize), &self.paste) {
            let is_new_scene = pane.scene != Some(model.header.id());
            let is_old = pane
                .drawn
                .as_ref()
                .is_none_or(|drawn| (&drawn.0, &drawn.1, &drawn.2, &drawn.3) != (&plane, &settings, &metal, field));
            if is_new_scene && may_compute {
                pane.scene = Some(model.header.id());
                if let Some(body) = Body::of_scene(&model.header, &model.labels) {
                    pane.scanner.set_body(&body, field);
                }
            }
            if (is_new_scene || is_old) && may_compute {
                self.computed_in = pass;
                pane.scanner.set_field(field);
                pane.pasted = pane
                    .scanner
                    .picture(&plane, &settings, &metal)
                    .map(|view| paste.of(&view));
                pane.drawn = Some((plane, settings, metal, field.clone()));
            } else if is_old {
                ui.ctx().request_repaint();
            }
            if let Some(pasted) = &pane.pasted {
                pasted.paint(&painter, rect);
                self.over(&painter, rect, &plane, model);
                return;
            }
        }
        painter.rect_filled(rect, 0.0, IMAGE.background);
        if rect.height() >= ROOM_FOR_REASON {
            let why = "No ultrasound: no wgpu device that computes, or the scene is too large for it";
            words(&painter, rect, why, IMAGE.text);
        }
    }

    /// Title and template.
    fn over(&self, painter: &egui::Painter, rect: Rect, plane: &Plane, model: &stylet_host::link::SceneModel) {
        if self.knobs.template && plane.view == View::Transverse {
            let template = Template::before(&model.header);
            let per_pixel = rect.width() / plane.pixels[0] as f32;
            for hole in Hole::all() {
                let place = Vector3::from(template.hole_m(hole));
                if let Some(at) = plane.crossing(place, template.inwards.into()) {
                    let at = rect.min + Vec2::new(at.x as f32, at.y as f32) * per_pixel;
                    painter.circle_filled(at, 1.3, IMAGE.gland.gamma_multiply(0.8));
                }
            }
        }
        let way = format::length(self.knobs.way_mm * 1e-3);
        let text = format!("{}  {way}", plane.view.name());
        let at: Pos2 = rect.left_top() + Vec2::new(9.0, 6.0);
        painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(12.5), IMAGE.text);
    }
}
