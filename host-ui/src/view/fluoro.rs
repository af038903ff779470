//! Fluoroscopy: a C-arm that turns, its beam on request, the last image held, and the dose spent.
//!
//! A pulse is computed on a separate thread, so that no frame waits for it.

mod tools;
mod words;

use super::body::ShownBody;
use super::paste::{Paste, Pasted, gpu_of};
use super::slice;
use crate::shown::Shown;
use crate::theme::{self, IMAGE};
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use egui::emath::GuiRounding as _;
use egui::{Rect, Sense, Vec2};
use nalgebra::Vector3;
use std::sync::{Arc, OnceLock};
use stylet_base::job::{Job, JobUpdate};
use stylet_imaging::fluoroscopy::{Attenuation, CArm, DoseCounter, Exposure, Fluoroscope};
use stylet_imaging::{Body, Gpu};
use stylet_shm_schema::{SceneHeader, SceneId};
use stylet_surfaces::field::Field;
use web_time::{Duration, Instant};

/// Side of a picture in pixels.
const SIDE: u32 = 512;
/// Range of the arm, degrees.
const ORBITAL_DEG: f64 = 100.0;
const CRANIAL_DEG: f64 = 40.0;
/// Length of a drag that turns the arm by a degree, in points.
const POINTS_PER_DEG: f64 = 3.0;
/// Time after which a frame looks for a picture again.
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// Patient: a run of the core and its scene.
type Case = (u64, SceneId);

/// Tube, arm and screen.
#[derive(Default)]
pub(super) struct FluoroView {
    screen: Option<Screen>,
    tube: Option<Arc<Fluoroscope>>,
    /// Pulse that is being computed: the arm, and the greys of its picture.
    pulse: Option<Job<(CArm, Vec<u8>)>>,
    case: Option<(Case, Arc<Patient>)>,
    held: Option<Held>,
    pub dose: DoseCounter,
    angles: Angles,
    /// State of the latching switch; a key counts while it is held.
    is_switched_on: bool,
    is_key_held: bool,
}

/// Angles of the arm, degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Angles {
    orbital: f64,
    cranial: f64,
}

impl Angles {
    fn turn(&mut self, orbital: f64, cranial: f64) {
        self.orbital = (self.orbital + orbital).clamp(-ORBITAL_DEG, ORBITAL_DEG);
        self.cranial = (self.cranial + cranial).clamp(-CRANIAL_DEG, CRANIAL_DEG);
    }
}

/// Body of a case. Its attenuation is made by the thread of the first pulse.
struct Patient {
    body: Body,
    attenuation: OnceLock<Attenuation>,
}

/// Graphics resources of the screen.
struct Screen {
    gpu: Gpu,
    paste: Paste,
}

/// Last picture.
struct Held {
    pasted: Pasted,
    arm: CArm,
    /// Time at which its pulse began.
    at: Instant,
}

impl FluoroView {
    /// Creates the view. Without a graphics device that computes there are no pictures.
    pub fn new(state: Option<RenderState>) -> Self {
        let screen = state.and_then(|state| {
            let gpu = gpu_of(&state);
            gpu.computes().then(|| Screen {
                gpu,
                paste: Paste::new(&state),
            })
        });
        Self {
            screen,
            ..Self::default()
        }
    }

    fn is_on(&self) -> bool {
        self.is_switched_on || self.is_key_held
    }

    /// Releases the key's beam when the layout is left.
    pub fn release(&mut self) {
        (self.is_switched_on, self.is_key_held) = (false, false);
    }

    /// Begins another patient: no dose spent, and no picture held.
    pub fn begin_case(&mut self) {
        self.held = None;
        self.dose = DoseCounter::default();
        self.pulse = None;
    }

    /// Draws the screen, and takes the next pulse while the beam is on.
    pub fn picture_ui(&mut self, ui: &mut egui::Ui, rect: Rect, (shown, body, field): (&Shown, &ShownBody, &Field)) {
        let response = ui.interact(rect, ui.scope_id().with("fluoroscopy"), Sense::drag());
        let name = "C-arm screen";
        theme::named(&response, egui::accesskit::Role::Image, || name);
        let by = response.drag_delta();
        self.angles
            .turn(f64::from(by.x) / POINTS_PER_DEG, f64::from(-by.y) / POINTS_PER_DEG);
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 0.0, IMAGE.background);
        let Some(model) = body.model.as_ref().filter(|_| shown.scene.is_some()) else {
            self.release();
            slice::words(&painter, rect, &format!("{name}: no scene yet"), IMAGE.text);
            return;
        };
        let case = (shown.session.map_or(0, |s| s.session_id), model.header.id());
        if self.case.as_ref().is_none_or(|(before, _)| *before != case) {
            self.begin_case();
            self.release();
            let patient = |body| Patient {
                body,
                attenuation: OnceLock::new(),
            };
            let body = Body::of_scene(&model.header, &model.labels);
            self.case = body.map(|body| (case, Arc::new(patient(body))));
        }
        let arm = self.arm(&model.header);
        self.take_pulse();
        if self.is_on() {
            self.begin_pulse(arm, shown, field);
        }
        if self.is_on() || self.pulse.is_some() {
            ui.ctx().request_repaint_after(LOOK_AGAIN);
        }
        if self.screen.is_none() {
            slice::words(
                &painter,
                rect,
                "No fluoroscopy: no wgpu device that computes",
                IMAGE.text,
            );
            return;
        }
        let edge = rect.width().min(rect.height());
        let square =
            Rect::from_center_size(rect.center(), Vec2::splat(edge)).round_to_pixels(ui.ctx().pixels_per_point());
        if let Some(held) = &self.held {
            held.pasted.paint(&ui.painter_at(square), square);
        }
        self.words_over(&painter, rect, square, arm);
    }

    fn arm(&self, scene: &SceneHeader) -> CArm {
        let middle_m = (Vector3::from(scene.target_lower_m) + Vector3::from(scene.target_upper_m)) * 0.5;
        CArm {
            pixels: [SIDE; 2],
            orbital: self.angles.orbital.to_radians(),
            cranial: self.angles.cranial.to_radians(),
            ..CArm::about(middle_m, scene.patient().rotation().transpose())
        }
    }

    fn begin_pulse(&mut self, arm: CArm, shown: &Shown, field: &Field) {
        let exposure = Exposure::FLUOROSCOPY;
        let is_due = |held: &Held| held.at.elapsed().as_secs_f64() >= exposure.beam_s;
        if self.pulse.is_some() || !self.held.as_ref().is_none_or(is_due) {
            return;
        }
        let (Some(screen), Some((_, patient))) = (&self.screen, &self.case) else {
            return;
        };
        let (patient, field, metal) = (Arc::clone(patient), field.clone(), shown.metal());
        let new = || Arc::new(Fluoroscope::new(screen.gpu.clone()));
        let tube = Arc::clone(self.tube.get_or_insert_with(new));
        self.pulse = Some(Job::begin("fluoroscopy", move |sender, _| {
            let body = patient.attenuation.get_or_init(|| Attenuation::smooth(&patient.body));
            // The window may have closed, so the picture may have no receiver.
            let _ = sender.send((arm, tube.shoot(&arm, body, &field, &metal).greys()));
        }));
        self.dose.count(&exposure, &arm);
        if let Some(held) = &mut self.held {
            held.at = Instant::now();
        }
    }

    fn take_pulse(&mut self) {
        let Some(job) = &self.pulse else { return };
        match job.poll() {
            JobUpdate::Pending => {}
            JobUpdate::Ended => self.pulse = None,
            JobUpdate::Message((arm, greys)) => {
                self.pulse = None;
                let at = self.held.take().map_or_else(Instant::now, |held| held.at);
                self.held = self.screen.as_ref().and_then(|screen| screen.held(arm, &greys, at));
            }
        }
    }
}

impl Screen {
    fn held(&self, arm: CArm, greys: &[u8], at: Instant) -> Option<Held> {
        let [width, height] = arm.pixels;
        if greys.len() != width as usize * height as usize {
            return None;
        }
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let texture = self.gpu.picture(arm.pixels, 1, wgpu::TextureFormat::Rgba8Unorm, usage);
        let pixels: Vec<u8> = greys.iter().flat_map(|&grey| [grey, grey, grey, 255]).collect();
        self.gpu.write(&texture, &pixels, 4);
        let view = texture.create_view(&Default::default());
        Some(Held {
            pasted: self.paste.enlarged(&view),
            arm,
            at,
        })
    }
}
