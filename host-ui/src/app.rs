//! The window: takes what is new, draws the panels, carries out what they ask for. A frame never waits.

use crate::files::LabelVolume;
use crate::link::{Link, LinkStatus};
use crate::loader::Loader;
use crate::panel::history::History;
use crate::panel::parameters::{ParametersState, parameters_ui};
use crate::panel::workflow::{WorkflowState, workflow_ui};
use crate::panel::{Action, LoadState, Note, Shown, help, plots, status};
use crate::view::scene3d::Scene3d;
use crate::workflow::{Pace, Run, RunStatus, default_plan, move_values, plan_values};
use crate::{keyboard, theme};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use stylet_shm_schema::service::Instance;
use stylet_shm_schema::{CommandKind, PARAMETERS};

const LIVE_FRAME: Duration = Duration::from_millis(16);
const ABSENT_FRAME: Duration = Duration::from_millis(250);
const SUM_UP_EVERY: Duration = Duration::from_millis(500);
/// The goal of a driven needle runs ahead of the tip by no more than this, so that it stops when the key is let go.
const LEAD_M: f64 = 0.004;
/// A longer frame counts as this long, so that a hiccup is not a jump of the needle.
const LONGEST_FRAME_S: f64 = 0.05;
/// Answers that are waited for at once; an older one is no longer told.
const WAITING_AT_MOST: usize = 64;
/// No answer within this time is told as such.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);

#[derive(Clone, Debug)]
pub struct Options {
    pub instance: Instance,
    /// Read and sent as soon as a core is there.
    pub scene: Option<PathBuf>,
    /// Which label of the file is the gland; all of them when none is given.
    pub label: Option<u8>,
}

/// A command that has not been answered yet.
struct Waiting {
    id: u64,
    what: &'static str,
    since: Instant,
}

pub struct App {
    link: Link,
    label: Option<u8>,
    /// From the command line, until it is read.
    first_scene: Option<PathBuf>,
    shown: Shown,
    view: Scene3d,
    history: History,
    summed_up: Instant,
    loader: Loader,
    uploading: Option<(u64, String)>,
    run: Option<Run>,
    pace: Pace,
    waiting: Vec<Waiting>,
    /// Where a driven needle is sent, along the path from the entry.
    goal_m: Option<f64>,
    workflow: WorkflowState,
    parameters: ParametersState,
    help: bool,
}

/// Opens the window and returns when it is closed.
pub fn run(options: Options) -> Result<(), String> {
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Stylet")
            .with_app_id("stylet")
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([960.0, 600.0])
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(|cc| Ok(Box::new(App::new(cc, options))));
    eframe::run_native("Stylet", native, create).map_err(|e| {
        format!(
            "cannot open a window: {e}. It needs a display (DISPLAY or WAYLAND_DISPLAY) and a graphics driver (mesa-vulkan-drivers); \
             without them use `host-ui procedure`"
        )
    })
}

impl App {
    /// What the window knows of the core.
    pub fn link(&self) -> &Link {
        &self.link
    }

    pub fn new(cc: &eframe::CreationContext<'_>, options: Options) -> Self {
        theme::apply(&cc.egui_ctx);
        let shown = Shown::empty(options.instance.name());
        Self {
            link: Link::new(options.instance),
            label: options.label,
            first_scene: options.scene,
            shown,
            view: Scene3d::new(cc.wgpu_render_state.clone()),
            history: History::default(),
            summed_up: Instant::now(),
            loader: Loader::default(),
            uploading: None,
            run: None,
            pace: Pace::default(),
            waiting: Vec::new(),
            goal_m: None,
            workflow: WorkflowState::default(),
            parameters: ParametersState::default(),
            help: false,
        }
    }

    /// All that came since the last frame.
    fn take(&mut self) {
        self.link.poll();
        self.shown.take(&self.link);
        let direction = self.shown.state.map_or([0.0, 0.0, 1.0], |s| s.needle_direction);
        let records = self.link.take_records();
        self.history.take(&records, direction);
        if self.summed_up.elapsed() >= SUM_UP_EVERY {
            self.summed_up = Instant::now();
            self.history.sum_up();
        }
        self.take_answers();
        self.take_scene_file();
        self.advance_run();
        self.view.take(&self.shown, self.link.scene(), self.link.snapshot());
    }

    fn take_answers(&mut self) {
        if self.shown.is_absent() {
            self.parameters.forget();
            self.waiting.clear();
            self.goal_m = None;
            if self.uploading.take().is_some() {
                self.shown.load = LoadState::Refused("rt-core went away before it answered".to_owned());
            }
            return;
        }
        if let Some(id) = self.parameters.waiting_for()
            && let Some(answer) = self.link.reply(id)
        {
            self.parameters
                .answered(answer.accepted, &answer.text, answer.effective_tick);
        }
        let (link, note) = (&mut self.link, &mut self.shown.note);
        self.waiting.retain(|w| match link.reply(w.id) {
            Some(answer) if answer.accepted => {
                // An old refusal is no longer true once something was accepted.
                *note = None;
                false
            }
            Some(answer) => {
                *note = Some(refusal(format!("{} refused: {}", w.what, answer.text)));
                false
            }
            None if w.since.elapsed() > ANSWER_WITHIN => {
                *note = Some(refusal(format!("{}: no answer from rt-core", w.what)));
                false
            }
            None => true,
        });
        let answer = self.uploading.as_ref().and_then(|(id, _)| self.link.reply(*id));
        if let (Some(answer), Some((_, name))) = (answer, self.uploading.clone()) {
            self.uploading = None;
            self.shown.load = match answer.accepted {
                true => LoadState::Loaded(format!("{name} is the scene now")),
                false => LoadState::Refused(format!("{name} refused: {}", answer.text)),
            };
        }
    }

    fn take_scene_file(&mut self) {
        if self.shown.is_live()
            && let Some(path) = self.first_scene.take()
        {
            self.load(&path);
        }
        match self.loader.poll() {
            None => {}
            Some(Err(why)) => self.shown.load = LoadState::Refused(why),
            Some(Ok(volume)) => self.upload(&volume),
        }
    }

    fn load(&mut self, path: &Path) {
        if self.shown.load.is_busy() {
            return;
        }
        self.shown.load = LoadState::Reading(format!("reading {}", path.display()));
        self.loader.begin(path, self.label);
    }

    fn upload(&mut self, volume: &LabelVolume) {
        let mut name = volume.name.clone();
        for warning in &volume.warnings {
            name = format!("{name} ({warning})");
        }
        self.shown.load = match self.link.upload(volume) {
            Err(e) => LoadState::Refused(e.to_string()),
            Ok(id) => {
                let text = format!("sending {}", volume.name);
                self.uploading = Some((id, name));
                LoadState::Sending(text)
            }
        };
    }

    fn advance_run(&mut self) {
        if let Some(run) = &mut self.run {
            let status = run.advance(&mut self.link);
            self.shown.run_step = Some(run.step());
            self.shown.note = match status {
                RunStatus::Working => None,
                RunStatus::Done => Some(Note {
                    refused: false,
                    text: "All four steps are done.".to_owned(),
                }),
                RunStatus::Failed(why) => Some(refusal(format!("The run stopped: {why}"))),
            };
            if self.shown.note.is_some() {
                self.run = None;
            }
        }
        self.shown.running = self.run.is_some();
    }

    fn send(&mut self, what: &'static str, kind: CommandKind, values: &[f64]) {
        match self.link.send(kind, values) {
            Ok(id) => {
                if self.waiting.len() >= WAITING_AT_MOST {
                    self.waiting.remove(0);
                }
                self.waiting.push(Waiting {
                    id,
                    what,
                    since: Instant::now(),
                });
            }
            Err(e) => self.shown.note = Some(refusal(format!("{what}: {e}"))),
        }
    }

    /// Sends the hand to a depth along the planned path.
    fn move_to(&mut self, what: &'static str, depth_m: f64, speed_m_per_s: f64) {
        let (Some(plan), Some(goal)) = (self.shown.plan, self.shown.on_path_m(depth_m)) else {
            self.shown.note = Some(refusal(format!("{what}: plan the seeds first")));
            return;
        };
        let values = move_values(goal, plan.direction, speed_m_per_s, self.pace.acceleration_m_per_s2);
        self.send(what, CommandKind::MoveHand, &values);
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::ToggleHelp => self.help = !self.help,
            Action::OpenParameters => self.parameters.open = !self.parameters.open,
            Action::ResetView => self.view.reset_view(&self.shown),
            Action::LoadScene(path) => self.load(&path),
            Action::StopRun => self.stop_run(),
            // While the script runs the needle is its own.
            _ if self.run.is_some() && action != Action::Send(CommandKind::Disengage) => {}
            Action::RunAll => {
                if let Some(scene) = &self.shown.scene {
                    self.run = Some(Run::new(default_plan(scene), self.pace));
                }
            }
            Action::PlanSeeds => {
                if let Some(scene) = &self.shown.scene {
                    let values = plan_values(&default_plan(scene));
                    self.send("Plan five seeds", CommandKind::SetPlan, &values);
                }
            }
            Action::LoadBuiltinScene(number) => {
                self.send("Built-in scene", CommandKind::LoadBuiltinScene, &[number as f64]);
            }
            Action::PlaceNeedle => self.move_to("Place needle", 0.0, self.pace.approach_m_per_s),
            Action::Insert => {
                let depth = self.shown.deepest_seed_m().unwrap_or(0.0);
                self.move_to("Insert", depth, self.pace.insert_m_per_s);
            }
            Action::Retract => self.move_to("Retract", 0.0, self.pace.retract_m_per_s),
            Action::MoveTo(depth) => self.move_to("Depth", depth, self.pace.insert_m_per_s),
            Action::Send(kind) => self.send(command_name(kind), kind, &[]),
        }
    }

    /// The needle stays where it is; the force stays as it is.
    fn stop_run(&mut self) {
        self.run = None;
        self.shown.running = false;
        if let Some(depth) = self.shown.path_depth_m() {
            self.move_to("Stop", depth, self.pace.insert_m_per_s);
        }
    }

    /// Held keys move the goal along the path; letting go stops it where the tip is.
    fn drive(&mut self, speed_m_per_s: f64, frame_s: f64) {
        if self.run.is_some() || !self.shown.is_live() {
            self.goal_m = None;
            return;
        }
        if speed_m_per_s == 0.0 {
            if self.goal_m.take().is_some()
                && let Some(depth) = self.shown.path_depth_m()
            {
                self.move_to("Needle", depth, self.pace.insert_m_per_s);
            }
            return;
        }
        let (Some(depth), Some(length)) = (self.shown.path_depth_m(), self.shown.path_length_m()) else {
            self.shown.note = Some(refusal(
                "The keys follow the planned path: plan the seeds first.".to_owned(),
            ));
            return;
        };
        let step = speed_m_per_s * frame_s.min(LONGEST_FRAME_S);
        let ahead = (self.goal_m.unwrap_or(depth) + step).clamp(depth - LEAD_M, depth + LEAD_M);
        let goal = ahead.clamp(-0.02, length);
        self.goal_m = Some(goal);
        self.move_to("Needle", goal, speed_m_per_s.abs());
    }

    fn send_parameters(&mut self) {
        let Some(pairs) = self.parameters.request() else { return };
        let mut values = Vec::with_capacity(2 * pairs.len());
        for (index, value) in &pairs {
            if let Some(spec) = PARAMETERS.get(*index) {
                values.extend([f64::from(spec.id as u32), *value]);
            }
        }
        match self.link.send(CommandKind::SetParameters, &values) {
            Ok(id) => self.parameters.sent(id, pairs),
            Err(e) => self.parameters.not_sent(e.to_string()),
        }
    }

    fn frame_ui(&mut self, ui: &mut egui::Ui) -> Vec<Action> {
        let mut actions = Vec::new();
        let bar = egui::Frame::new()
            .fill(theme::PANEL)
            .inner_margin(egui::Margin::symmetric(10, 5));
        egui::Panel::top("status").frame(bar).show(ui, |ui| {
            actions.extend(status::status_ui(ui, &self.shown));
        });
        let banners = status::banners(&self.shown);
        if !banners.is_empty() {
            egui::Panel::top("banners").frame(egui::Frame::new()).show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 1.0;
                actions.extend(status::banners_ui(ui, &banners));
            });
        }
        let left = egui::Panel::left("workflow")
            .exact_size(theme::LEFT_WIDTH)
            .frame(theme::side_panel());
        left.resizable(false).show(ui, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| {
                actions.extend(workflow_ui(ui, &self.shown, &mut self.workflow));
            });
        });
        let right = egui::Panel::right("plots")
            .exact_size(theme::RIGHT_WIDTH)
            .frame(theme::side_panel());
        right.resizable(false).show(ui, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| plots::plots_ui(ui, &self.shown, &self.history));
        });
        egui::CentralPanel::default()
            .frame(egui::Frame::new().fill(theme::BACKGROUND))
            .show(ui, |ui| self.view.scene3d_ui(ui, &self.shown));
        parameters_ui(ui.ctx(), &self.shown, &mut self.parameters);
        help::help_ui(ui.ctx(), &mut self.help);
        actions
    }

    fn dropped_file(ctx: &egui::Context) -> Option<Action> {
        let path = ctx.input(|i| {
            i.raw
                .dropped_files
                .iter()
                .map(|f| f.path().to_owned())
                .find(|p| !p.as_os_str().is_empty())
        })?;
        Some(Action::LoadScene(path))
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        self.take();
        let keys = keyboard::read(&ctx);
        let mut actions = self.frame_ui(ui);
        actions.extend(keys.actions);
        actions.extend(Self::dropped_file(&ctx));
        if ctx.input(|i| i.key_pressed(egui::Key::Escape)) {
            (self.help, self.parameters.open) = (false, false);
        }
        for action in actions {
            self.act(action);
        }
        self.drive(keys.drive_m_per_s, f64::from(ctx.input(|i| i.stable_dt)));
        self.send_parameters();
        ctx.request_repaint_after(match self.shown.status {
            LinkStatus::Live => LIVE_FRAME,
            LinkStatus::Silent { .. } | LinkStatus::Absent { .. } => ABSENT_FRAME,
        });
    }
}

fn refusal(text: String) -> Note {
    Note { refused: true, text }
}

fn command_name(kind: CommandKind) -> &'static str {
    match kind {
        CommandKind::SetParameters => "Parameters",
        CommandKind::SetPlan => "Plan",
        CommandKind::MoveHand => "Needle",
        CommandKind::DropSeed => "Drop seed",
        CommandKind::Engage => "Engage force",
        CommandKind::Disengage => "Disengage",
        CommandKind::Reset => "Reset",
        CommandKind::LoadBuiltinScene => "Built-in scene",
        CommandKind::UndoSeed => "Undo seed",
        CommandKind::Shutdown => "Shutdown",
        CommandKind::SaveFlight => "Flight recording",
        CommandKind::Rehearse => "Rehearsal",
    }
}
