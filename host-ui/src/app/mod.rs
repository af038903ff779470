//! The window: takes new data, draws the panels, executes their requests. A frame never waits.

mod act;
#[cfg(not(target_family = "wasm"))]
mod core;
mod debrief;
#[cfg(not(target_family = "wasm"))]
mod desktop;
mod drive;
#[cfg(target_family = "wasm")]
mod dropped;
#[cfg(not(target_family = "wasm"))]
mod error;
mod files;
mod frames;
mod layout;
#[cfg(not(target_family = "wasm"))]
mod open;
mod options;
mod patch;
mod plan;
mod second;
mod take;
mod trainees;
mod watch;

use crate::action::Action;
use crate::dialog::Dialogs;
use crate::dose_worker::DoseWorker;
use crate::loader::Loader;
use crate::panel::history::History;
use crate::panel::instructor::InstructorState;
use crate::panel::parameters::ParametersState;
use crate::panel::question::Question;
use crate::panel::workflow::WorkflowState;
#[cfg(not(target_family = "wasm"))]
use crate::picture::Pictures;
use crate::planner::Planner;
use crate::redraw::Redraw;
use crate::settings::{self, Settings};
use crate::shown::{FrameCost, Note, Shown};
use crate::view::middle::Middle;
use crate::{cpu_time, keyboard, theme};
use std::rc::Rc;
use stylet_base::format;
use stylet_base::job::Job;
use stylet_base::lines::Lines;
use stylet_controllers::{Controllers, ProbeWish, SLOW, Wish};
use stylet_host::core_args::CoreArgs;
use stylet_host::link::{Link, LinkStatus};
use stylet_implant::received::ReceivedProcedure;
use stylet_implant::workflow::{Pace, Run};
use stylet_shm_schema::Instance;
#[cfg(not(target_family = "wasm"))]
use stylet_shm_schema::affinity::Left;
use web_time::{Duration, Instant};

const LIVE_FRAME: Duration = Duration::from_millis(16);
const ABSENT_FRAME: Duration = Duration::from_millis(250);

#[cfg(not(target_family = "wasm"))]
pub use error::WindowError;
#[cfg(not(target_family = "wasm"))]
pub use open::run;
pub use options::Options;

/// Command without an answer so far.
struct Waiting {
    id: u64,
    what: &'static str,
    since: Instant,
}

/// Makes the link to the core of a window.
pub type Home = Rc<dyn Fn(Instance) -> Link>;

/// Window of the program.
pub struct App {
    link: Link,
    /// Connects to the core of this window, also after a recording.
    home: Home,
    #[cfg(not(target_family = "wasm"))]
    started_core: Option<core::StartedCore>,
    shown: Shown,
    middle: Middle,
    dose: DoseWorker,
    #[cfg(not(target_family = "wasm"))]
    pictures: Pictures,
    settings: Settings,
    /// Settings when they were last applied, and how much the window enlarged text, and could at most.
    applied: Option<(Settings, [f32; 2])>,
    history: History,
    /// Procedure as any host receives it.
    heard: ReceivedProcedure,
    debrief: Option<Job<debrief::Saved>>,
    summed_up: Instant,
    loader: Loader,
    dialogs: Dialogs,
    files: files::SceneFiles,
    run: Option<Run>,
    /// True if the core was absent in the last frame.
    was_absent: bool,
    /// Question that waits for an answer.
    question: Option<Question>,
    script: plan::Script,
    placed_found: Instant,
    planner: Planner,
    recording: watch::Recording,
    pace: Pace,
    waiting: Vec<Waiting>,
    controllers: Controllers,
    pause: bool,
    frame_lines: Option<Lines>,
    patch: Option<patch::Patch>,
    frames: frames::Frames,
    /// Processor core that this program leaves to the force loop.
    #[cfg(not(target_family = "wasm"))]
    left_core: Left,
    drive: drive::Drive,
    second_drive: second::SecondDrive,
    /// Buttons of gamepads and 3D mice since the last frame.
    pressed: Vec<Action>,
    /// Place to which a hand has pulled the tip in this frame, and the last one that was sent.
    pulled_to_m: Option<f64>,
    pulled_goal_m: Option<f64>,
    /// Run of the core, and number of its refusals that were dismissed.
    dismissed: (u64, u64),
    workflow: WorkflowState,
    parameters: ParametersState,
    help: bool,
    class: bool,
    instructor: InstructorState,
    trainees: trainees::Trainees,
    /// Content of the middle if there is no room for the right panel.
    narrow: layout::Narrow,
}

impl App {
    /// Returns the state of the link to the core.
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// Returns the plan of many needles.
    pub fn planner(&self) -> &Planner {
        &self.planner
    }

    /// Returns the pictures in the middle, and their cut planes.
    pub fn middle(&self) -> &Middle {
        &self.middle
    }

    /// Returns the cost of the last frame.
    pub fn cost(&self) -> FrameCost {
        self.shown.cost
    }

    /// Creates the window with these options, before its first frame.
    pub fn new(cc: &eframe::CreationContext<'_>, options: Options) -> Self {
        Self::with_home(cc, options, Rc::new(Link::new))
    }

    /// As [`App::new`], with the core that `home` connects to.
    pub fn with_home(cc: &eframe::CreationContext<'_>, options: Options, home: Home) -> Self {
        theme::apply(&cc.egui_ctx);
        if let Some(state) = &cc.wgpu_render_state {
            cc.egui_ctx.add_plugin(Redraw::new(state.clone()));
        }
        let settings = Settings::read(cc.storage);
        let CoreArgs { instance, scene, label } = options.core;
        let shown = Shown::empty(instance.name());
        // A kept plan belongs to this window's core. A window that follows a trainee receives the
        // trainee's plan from the core.
        #[cfg(not(target_family = "wasm"))]
        let planner = match options.trainees.is_empty() {
            true => Planner::default().keeping_in(instance.folder()),
            false => Planner::default(),
        };
        #[cfg(target_family = "wasm")]
        let planner = Planner::default();
        let name = options.name.unwrap_or_else(|| instance.name().to_owned());
        Self {
            link: home(instance.clone()),
            home,
            #[cfg(not(target_family = "wasm"))]
            started_core: None,
            shown,
            middle: Middle::new(cc.wgpu_render_state.clone()),
            dose: DoseWorker::default(),
            #[cfg(not(target_family = "wasm"))]
            pictures: Pictures::default(),
            applied: None,
            history: History::default(),
            heard: ReceivedProcedure::default(),
            debrief: None,
            summed_up: Instant::now(),
            loader: Loader::default(),
            dialogs: Dialogs::default(),
            files: files::SceneFiles {
                label,
                first_scene: scene,
                first_image: options.image,
                ..Default::default()
            },
            run: None,
            was_absent: true,
            question: None,
            script: plan::Script::default(),
            placed_found: Instant::now(),
            planner,
            recording: watch::Recording::beginning_with(options.watch),
            pace: Pace::default(),
            waiting: Vec::new(),
            controllers: controllers(options.no_controllers),
            pause: !options.without_pause,
            frame_lines: options.count_frames.then(Lines::to_stderr),
            patch: options.patch.then(patch::Patch::default),
            frames: frames::Frames::new(Instant::now()),
            #[cfg(not(target_family = "wasm"))]
            left_core: Left::default(),
            drive: drive::Drive::default(),
            second_drive: second::SecondDrive::default(),
            pressed: Vec::new(),
            pulled_to_m: None,
            pulled_goal_m: None,
            dismissed: (0, 0),
            workflow: WorkflowState::with_file(settings.last_file()),
            settings,
            parameters: ParametersState::default(),
            help: false,
            class: false,
            instructor: InstructorState::default(),
            trainees: trainees::Trainees::new(options.trainees, options.class, name),
            narrow: layout::Narrow::default(),
        }
    }

    /// Sets whether a frame redraws only the changed parts of the window.
    pub fn draw_changes_only(ctx: &egui::Context, only: bool) {
        ctx.with_plugin(|redraw: &mut Redraw| redraw.switch(only));
    }

    /// Redraws all of the last frame at once.
    pub fn draw_all_again(ctx: &egui::Context) {
        ctx.with_plugin(|redraw: &mut Redraw| redraw.again(ctx));
    }

    fn refuse(&mut self, why: impl ToString) {
        self.shown.note = Some(Note::refusal(why));
    }

    /// Replaces the devices of the system.
    pub fn use_controllers(&mut self, controllers: Controllers) {
        self.controllers = controllers;
    }

    /// Applies the settings and the size of the window that changed since the last frame.
    fn apply_settings(&mut self, ctx: &egui::Context) {
        self.settings.take_keys(ctx);
        let fit = settings::fit_of(ctx);
        let applied = self.applied.as_ref();
        if applied.is_none_or(|(of, before)| *of != self.settings || *before != fit) {
            self.settings.apply(ctx, fit);
            self.applied = Some((self.settings.clone(), fit));
        }
    }

    /// Returns the requested speed. Keys take precedence over a stick or a cap, which has no effect
    /// while another window has the focus.
    fn wish(&self, ctx: &egui::Context, keys_m_per_s: f64) -> Wish {
        if keys_m_per_s != 0.0 {
            return Wish {
                along_m_per_s: keys_m_per_s,
                ..Wish::REST
            };
        }
        let may_move = self.shown.has_focus && self.question.is_none();
        match (may_move, ctx.input(|i| i.modifiers.shift)) {
            (false, _) => Wish::REST,
            (true, false) => self.shown.controllers.wish,
            (true, true) => self.shown.controllers.wish.slower(SLOW),
        }
    }
}

impl App {
    /// Returns the requested speed of the probe, from a second gamepad.
    fn probe_wish(&self, ctx: &egui::Context) -> ProbeWish {
        match (self.shown.has_focus, ctx.input(|i| i.modifiers.shift)) {
            (false, _) => ProbeWish::default(),
            (true, false) => self.shown.controllers.probe,
            (true, true) => self.shown.controllers.probe.slower(SLOW),
        }
    }
}

#[cfg(not(target_family = "wasm"))]
fn controllers(none: bool) -> Controllers {
    match none {
        true => Controllers::none(),
        false => Controllers::start(stylet_controllers::System::default()),
    }
}

#[cfg(target_family = "wasm")]
fn controllers(_none: bool) -> Controllers {
    Controllers::none()
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        let begun_ns = cpu_time::thread_ns();
        let driver = self.middle.driver();
        self.apply_settings(&ctx);
        self.shown.has_focus = ctx.input(|i| i.focused);
        self.take();
        let keys = keyboard::read(&ctx);
        let mut actions = self.frame_ui(ui);
        actions.extend(keys.actions);
        actions.append(&mut self.pressed);
        actions.extend(self.dropped_file(&ctx));
        actions.extend(self.picked_file());
        if ctx.input(|i| i.key_pressed(egui::Key::Escape)) {
            (self.help, self.class, self.parameters.open) = (false, false, false);
            self.instructor.close();
            self.question = None;
        }
        for action in actions {
            self.act(action, &ctx);
        }
        let wish = self.wish(&ctx, keys.drive_m_per_s);
        // `stable_dt` is unsuitable: it assumes a fast frame whenever a frame was requested with a
        // delay.
        let frame_s = f64::from(ctx.input(|i| i.unstable_dt));
        self.drive(wish, frame_s);
        self.drive_second(keys.second_m_per_s, self.probe_wish(&ctx), frame_s);
        self.send_parameters();
        let asked = self.middle.driver();
        let driver_ns = asked.cpu_ns - driver.cpu_ns;
        let all_ns = cpu_time::thread_ns().saturating_sub(begun_ns);
        // The redraw plan of the previous frame: the present one is drawn once it is complete.
        let redraw = ctx
            .with_plugin(|redraw: &mut Redraw| redraw.take_cost())
            .unwrap_or_default();
        self.shown.cost = FrameCost {
            cpu_us: format::us(all_ns.saturating_sub(driver_ns) + redraw.own_ns),
            driver_us: format::us(driver_ns + redraw.driver_ns),
            uploaded_bytes: asked.uploaded_bytes - driver.uploaded_bytes,
        };
        let counted = self.frames.count(Instant::now(), &self.shown.cost);
        if let (Some((rate_hz, mean)), Some(lines)) = (counted, &self.frame_lines) {
            let [ours_ms, driver_ms] = [mean.cpu_us, mean.driver_us].map(|us| us * 1e-3);
            let words = format!("{rate_hz:.1} frames/s, {ours_ms:.2} ms a frame, {driver_ms:.2} in the driver");
            lines.say(format!("host-ui: {words}"));
        }
        ctx.request_repaint_after(match self.shown.status {
            LinkStatus::Live if self.pause => LIVE_FRAME,
            LinkStatus::Live => Duration::ZERO,
            LinkStatus::Silent { .. } | LinkStatus::Absent { .. } => ABSENT_FRAME,
        });
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        self.settings.write(storage);
    }
}

#[cfg(test)]
pub(crate) mod tests;
