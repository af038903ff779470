//! Takes the data that arrived since the last frame: records, answers, loaded files, the script's
//! next action.

use super::App;
use super::drive::Drive;
use super::files::Going;
use crate::action::Action;
use crate::dose_worker::DoseRequest;
use crate::panel::workflow::SCRIPTED_STEPS;
use crate::shown::{LoadState, Note, all_errors};
use stylet_controllers::Button;
use stylet_implant::plan::Template;
use stylet_implant::workflow::{RunStatus, move_request};
use stylet_shm_schema::{Prescribed, Request, flags};
use web_time::{Duration, Instant};

const SUM_UP_EVERY: Duration = Duration::from_millis(500);
/// Distance from the template at which the needle begins in another scene.
const BEFORE_TEMPLATE_M: f64 = 0.02;
/// Time after which a request without an answer is shown.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);

impl App {
    /// Takes all data that arrived since the last frame.
    pub(super) fn take(&mut self) {
        self.take_recording();
        self.link.poll();
        let plan_before = self.shown.plan.map(|p| p.generation);
        let scene_before = self.shown.scene.map(|s| s.id());
        let given_up_before = self.shown.given_up_at;
        let session_before = self.shown.session.map(|s| s.session_id);
        self.shown.take(&self.link);
        if self.shown.scene.map(|s| s.id()) != scene_before {
            // The file of another scene's plan is not replaced by this one's, and its gland lies elsewhere.
            self.workflow.plan.forget_scene();
            let begins = std::mem::take(&mut self.files.begins_outside);
            if begins && self.shown.has_flag(flags::SIMULATED_DEVICE) {
                self.files.going_outside = Going::Due;
            }
        }
        self.begin_outside();
        #[cfg(not(target_family = "wasm"))]
        self.take_desktop();
        self.keep_of_ended_core();
        self.take_stepper();
        if self.shown.plan.map(|p| p.generation) != plan_before {
            self.drive = Drive::default();
        }
        let direction = self.shown.state.map_or([0.0, 0.0, 1.0], |s| s.needle_direction);
        let records = self.link.take_records();
        self.history.take(&records, direction);
        self.workflow.guide.membranes.take(&records);
        // The window shows only the state of the second hand, not its records.
        let _second = self.link.take_second_records();
        self.heard.take(&self.link, &records);
        self.shown.heard = self.heard.planned(self.settings.seed_strength_u);
        if self.summed_up.elapsed() >= SUM_UP_EVERY {
            self.summed_up = Instant::now();
            self.history.sum_up();
        }
        self.take_controllers();
        self.take_answers(self.shown.session.map(|s| s.session_id) != session_before);
        self.take_scene_file();
        self.advance_run();
        self.take_given_up(given_up_before);
        self.take_plan();
        if let (Some(scene), Some(snapshot)) = (self.link.scene(), self.link.snapshot()) {
            self.shown.take_places(scene, snapshot);
        }
        self.dose.take(self.link.scene(), &self.dose_request());
        self.shown.dose = self.dose.latest().cloned();
        self.shown.dose_trouble = self.dose.trouble();
        self.count_refusals();
        self.take_debrief();
        self.take_trainees();
        if std::mem::take(&mut self.middle.view.has_left_tip) {
            let text = "The slices no longer follow the tip. Press F to follow it again.";
            self.shown.note = Some(Note::done(text.to_owned()));
        }
        self.middle.take(&self.shown, self.link.scene(), self.link.snapshot());
    }

    /// Moves a simulated needle in front of the template of a scene that this window has loaded: at its place in the
    /// last scene it would lie in the new body. A window that draws a scene for the first time may answer too late for
    /// a motion, which is then sent again.
    fn begin_outside(&mut self) {
        let going = &mut self.files.going_outside;
        let (Some(scene), true) = (self.shown.scene, *going != Going::No) else {
            return;
        };
        let Template { middle_m, inwards, .. } = Template::before(&scene);
        let start_m = [0, 1, 2].map(|a| middle_m[a] - inwards[a] * BEFORE_TEMPLATE_M);
        if *going == Going::Sent {
            let is_near = |tip_m: [f64; 3]| (0..3).all(|a| (tip_m[a] - start_m[a]).abs() < 1e-3);
            if self.shown.state.is_some_and(|state| is_near(state.tip_in_scene_m)) {
                *going = Going::No;
            }
            return;
        }
        *going = Going::Sent;
        let pace = &self.pace;
        let request = move_request(start_m, inwards, pace.approach_m_per_s, pace.acceleration_m_per_s2);
        self.send("Needle", &request);
    }

    /// Returns the dose request: the plan while it is edited or nothing is placed, else the seeds
    /// at their actual positions.
    fn dose_request(&self) -> DoseRequest {
        let implant = self.shown.planning.implant.as_ref();
        match implant.filter(|_| self.edits_plan() || self.shown.seeds.is_empty()) {
            Some(implant) => DoseRequest::of_plan(&implant.plan, &implant.seeds, self.shown.body_moved_m),
            None => DoseRequest::in_tissue(&self.shown.seeds, &self.planned_as()),
        }
    }

    /// Returns the prescription of the seeds: from this window's plan, else from a received plan,
    /// else from the settings.
    pub(super) fn planned_as(&self) -> Prescribed {
        let implant = self.shown.planning.implant.as_ref();
        let first = implant.and_then(|i| i.plan.needles.iter().position(|n| !n.seeds.is_empty()));
        let own = implant
            .zip(first)
            .map(|(implant, first)| implant.plan.prescribed(first));
        own.unwrap_or_else(|| {
            let mut heard = self.heard.prescribed().unwrap_or_default();
            let is_others = self.trainees.followed.is_some() || self.watches();
            // A needle by hand uses the seeds of the settings at once.
            if heard.strength_u == 0.0 || heard.needle == 0 && !is_others {
                heard.strength_u = self.settings.seed_strength_u;
            }
            heard
        })
    }

    fn take_controllers(&mut self) {
        self.controllers.use_two_hands(self.shown.is_second_simulated());
        let (latest, pressed) = self.controllers.take();
        let before = std::mem::replace(&mut self.shown.controllers, latest);
        let now = &self.shown.controllers;
        if now.disconnections != before.disconnections {
            self.shown.disconnected = Some(now.disconnected.clone());
        } else if before.holder.is_none() && now.holder.is_some() {
            self.shown.disconnected = None;
        }
        // Buttons pressed while another window has the focus are meant for that window.
        if self.shown.has_focus {
            self.pressed.extend(pressed.into_iter().map(asked_by));
        }
    }

    /// Counts the refusals of this run of the core that were not dismissed.
    fn count_refusals(&mut self) {
        let Some(session) = &self.shown.session else { return };
        if self.dismissed.0 != session.session_id {
            self.dismissed = (session.session_id, session.refused);
        }
        self.shown.refusals = session.refused.saturating_sub(self.dismissed.1);
    }

    fn take_answers(&mut self, is_another_core: bool) {
        if self.shown.is_absent() || is_another_core {
            self.parameters.forget();
            self.waiting.clear();
            self.drive.forget();
            if self.files.uploading.take().is_some() {
                (self.files.image_to_come, self.files.begins_outside) = (None, false);
                self.shown.load = LoadState::Refused("rt-core ended before it replied".to_owned());
            }
            return;
        }
        if let Some(id) = self.parameters.waiting_for()
            && let Some(answer) = self.link.reply(id)
        {
            self.parameters.answered(&answer);
        }
        let (link, note) = (&mut self.link, &mut self.shown.note);
        self.waiting.retain(|w| match link.reply(w.id) {
            Some(answer) => {
                // An old refusal is obsolete once a request was accepted.
                let refused = |why| Note::refusal(format!("{} refused: {why}", w.what));
                *note = answer.err().map(refused);
                false
            }
            None => {
                let waited = w.since.elapsed();
                if waited > ANSWER_WITHIN && note.as_ref().is_none_or(|note| !note.refused) {
                    let text = format!("{}: waiting for rt-core to answer, {} s", w.what, waited.as_secs());
                    *note = Some(Note::done(text));
                }
                true
            }
        });
        let answer = self.files.uploading.as_ref().and_then(|(id, _)| self.link.reply(*id));
        if let (Some(answer), Some((_, name))) = (answer, self.files.uploading.clone()) {
            self.files.uploading = None;
            let image = self.files.image_to_come.take();
            if let Err(why) = answer {
                self.files.begins_outside = false;
                self.shown.load = LoadState::Refused(format!("{name} refused: {why}"));
                return;
            }
            self.files.scene_file = self.files.scene_to_come.take();
            if self.files.structures.take().is_some() {
                self.workflow.open_present();
            }
            self.shown.load = LoadState::Loaded(format!("{name} is loaded"));
            if let Some((image, scene)) = image {
                self.show_image(image, &scene);
            }
        }
    }

    /// Says why the needle stopped before its goal; a script starts again by itself.
    fn take_given_up(&mut self, before: Option<u64>) {
        /// Older than that, it was before this window.
        const NEW_TICKS: u64 = 2_000;
        let (at, Some(state)) = (self.shown.given_up_at, &self.shown.state) else {
            return;
        };
        let is_new = at.is_some_and(|at| state.tick.saturating_sub(at) < NEW_TICKS) && at != before;
        if is_new && self.files.going_outside == Going::Sent {
            self.files.going_outside = Going::Due;
        } else if is_new && self.run.is_none() && !self.watches() {
            self.refuse("The needle was stopped before its goal: its motion was not confirmed in time. Move it again.");
        }
    }

    /// Says how a run ended, with the planned seeds that are not in the tissue.
    fn end_of_run(&self) -> Note {
        let in_plan = self.planner.plan().map_or(0, |plan| plan.needles.len());
        let needles = if self.script.needles.is_empty() { 0 } else { in_plan };
        let seeds = all_errors(&self.shown);
        let missing = seeds.iter().filter(|(_, seed)| seed.placed.is_none()).count();
        match (needles, missing) {
            (0, _) => Note::done(format!("Done: {SCRIPTED_STEPS}.")),
            (n, 0) => Note::done(format!("All {n} needles are done.")),
            (n, missing) => Note::refusal(format!(
                "All {n} needles are done, but {missing} of {} seeds were not placed: the tip was outside the tissue.",
                seeds.len()
            )),
        }
    }

    fn advance_run(&mut self) {
        if let Some(run) = &mut self.run {
            let status = run.advance(&mut self.link);
            let needle = run.needle();
            self.shown.run_step = Some(run.step());
            self.shown.run_waits = Some(run.waiting());
            self.shown.run_needle = self.script.in_plan(needle, self.planner.plan());
            // One needle by hand has no plan whose drops could be counted.
            if !self.script.needles.is_empty() {
                self.planner.take_lost(run.lost());
            }
            self.follow_run(needle, status == RunStatus::Done);
            self.shown.note = match status {
                RunStatus::Working => None,
                RunStatus::Done => Some(self.end_of_run()),
                RunStatus::Failed(why) => Some(Note::refusal(format!("The run stopped: {why}"))),
            };
            if self.shown.note.is_some() {
                self.end_run();
            }
        }
        self.shown.running = self.run.is_some() || self.watches();
        self.find_placed();
    }
}

fn asked_by(button: Button) -> Action {
    match button {
        Button::Drop => Action::DropSeed,
        Button::Undo => Action::Undo,
        Button::Stop => Action::StopRun,
        Button::Engage => Action::Send(Request::Engage),
    }
}
