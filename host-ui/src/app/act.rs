//! Executes the operator's requests, after all panels are drawn.

use super::debrief::folder_of;
use super::drive::{BEFORE_ENTRY_M, Drive, Goal};
use super::files::Going;
use super::{App, Waiting};
use crate::action::{Action, PlanAction};
use crate::panel::question::{Begin, Question};
use crate::panel::workflow::{Undo, next_action, undo_action};
use crate::planner::Edit;
use crate::settings::ThemeChoice;
use crate::shown::LoadState;
use stylet_controllers::Wish;
use stylet_implant::workflow::{default_plan, move_request};
use stylet_shm_schema::{
    BUILTIN_SCENES, PARAMETERS, ParameterChange, ParameterProblems, ParameterSet, PlannedNeedle, ProblemList, Request,
};
use web_time::Instant;

/// Farthest goal ahead of the tip for a hand that pulls it.
const PULLED_M: f64 = 0.02;
/// Distance below which two goals count as the same.
const SAME_GOAL_M: f64 = 0.1e-3;
/// Most requests that wait for their answer at once; the answer of an older one is not shown.
const WAITING_AT_MOST: usize = 64;

impl App {
    pub(super) fn send(&mut self, what: &'static str, request: &Request) {
        match self.link.send(request) {
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
            Err(e) => self.refuse(format!("{what}: {e}")),
        }
    }

    pub(super) fn load_builtin(&mut self, number: usize) {
        let name = BUILTIN_SCENES[number];
        self.shown.load = match self.link.send(&Request::LoadBuiltinScene(number as u32)) {
            Err(e) => LoadState::Refused(e.to_string()),
            Ok(id) => {
                (self.files.scene_to_come, self.files.image_to_come) = (None, None);
                self.files.uploading = Some((id, name.to_owned()));
                self.files.begins_outside = true;
                LoadState::Sending(format!("building {name}"))
            }
        };
    }

    /// Sends the hand to a depth along the planned path, or along the parallel line on which the
    /// needle is.
    fn move_to(&mut self, what: &'static str, depth_m: f64, speed_m_per_s: f64) {
        let offset_m = self.drive.offset_m();
        self.move_hand(
            what,
            Goal {
                depth_m,
                offset_m,
                speed_m_per_s,
            },
        );
    }

    fn move_hand(&mut self, what: &'static str, to: Goal) {
        let goal = self.shown.place_near_path_m(to.depth_m, to.offset_m);
        let (Some(plan), Some(goal)) = (self.shown.plan, goal) else {
            self.refuse(format!("{what}: plan the seeds first"));
            return;
        };
        let request = move_request(goal, plan.direction, to.speed_m_per_s, self.pace.acceleration_m_per_s2);
        self.send(what, &request);
    }

    /// Executes a request, or asks first if it removes what is in the tissue.
    pub(super) fn act(&mut self, action: Action, ctx: &egui::Context) {
        self.files.going_outside = Going::No;
        // Until a question is answered the needle may only be stopped, and the force only go off.
        let passes = matches!(
            action,
            Action::Answer(_) | Action::StopRun | Action::Send(Request::Disengage)
        );
        if self.question.is_some() && !passes {
            return;
        }
        let question = Question::before(&action, &self.shown).filter(|_| self.run.is_none() && !self.watches());
        match question {
            Some(question) => self.question = Some(question),
            None => self.execute(action, ctx),
        }
    }

    /// Continues with what waited for the answer.
    fn answer(&mut self, is_agreed: bool, ctx: &egui::Context) {
        match self.question.take().filter(|_| is_agreed) {
            Some(Question::Rearm(begin)) => self.rearm(begin),
            Some(Question::Remove(_, action)) => {
                let folder = folder_of("before-reset");
                self.save_seeds(folder.clone());
                self.execute(*action, ctx);
                // Not before: no run begins while the planner writes.
                self.save_plan(&folder);
            }
            Some(Question::Replace(path)) => {
                self.workflow.plan.own_file = Some(path.clone());
                self.act_on_plan(PlanAction::Export(path));
            }
            None => {}
        }
    }

    fn execute(&mut self, action: Action, ctx: &egui::Context) {
        match action {
            Action::ToggleHelp => self.help = !self.help,
            Action::ToggleClass => self.class = !self.class,
            Action::Lease(request) => {
                if let Err(e) = self.link.lease(&request) {
                    self.refuse(format!("Needle: {e}"));
                }
            }
            Action::OpenParameters => self.parameters.open = !self.parameters.open,
            Action::ToggleInstructor => self.instructor.toggle(),
            Action::ResetView => self.middle.reset_view(&self.shown),
            Action::LookFrom(preset) => self.middle.solid.look_from(preset, &self.shown),
            Action::SetLayout(layout) => self.settings.layout = layout,
            Action::NextLayout => self.settings.layout = self.settings.layout.next(),
            Action::ToggleFollowTip => self.middle.view.follow_tip = !self.middle.view.follow_tip,
            Action::ToggleMeasure => self.middle.view.measure.toggle(),
            Action::ToggleIsodose => self.middle.view.isodose = !self.middle.view.isodose,
            Action::ToggleImage => self.middle.view.image = !self.middle.view.image,
            Action::ToggleTheme => {
                self.settings.theme = match self.settings.theme {
                    ThemeChoice::Dark => ThemeChoice::Light,
                    ThemeChoice::Light => ThemeChoice::Dark,
                };
            }
            Action::SaveDebrief => self.save_debrief(),
            #[cfg(not(target_family = "wasm"))]
            Action::SavePicture => self.pictures.request(ctx),
            #[cfg(not(target_family = "wasm"))]
            Action::StartCore => self.start_core(),
            #[cfg(target_family = "wasm")]
            Action::SavePicture | Action::StartCore => self.refuse("A web page saves no pictures and starts no core."),
            Action::ReduceNotRealTime => self.shown.reduced = self.shown.session.map(|s| s.session_id),
            Action::DismissDisconnected => self.shown.disconnected = None,
            Action::DismissRefusals => {
                if let Some(session) = &self.shown.session {
                    self.dismissed = (session.session_id, session.refused);
                }
            }
            Action::LoadScene(path) => self.load(&path, None),
            Action::LoadImage(path) => self.load_image(&path),
            Action::CancelLoad => {
                self.loader.cancel();
                self.shown.load = LoadState::Idle;
            }
            Action::Structures(action) => self.act_on_structures(action),
            Action::PickFile(purpose) => self.pick_file(purpose),
            Action::StopRun => self.stop_run(),
            Action::Trainee(action) => self.act_on_trainees(action),
            Action::Watch(action) => self.act_on_recording(action),
            _ if self.watches() => {
                self.refuse("This is a recording: close it to move the needle.");
            }
            // Instructors may mark and inject while a script or a trainee moves the needle.
            Action::Send(request @ (Request::Mark(_) | Request::BeginExercise(_) | Request::EndExercises)) => {
                self.send(request_name(&request), &request);
            }
            // The script does not use the other hand, so the operator keeps it.
            Action::Probe(action) => self.act_on_probe(action),
            // While the script runs, it owns the needle.
            _ if self.run.is_some() && action != Action::Send(Request::Disengage) => {}
            Action::Next => {
                // An executed action reports its own name.
                if let Some(action) = next_action(&self.shown) {
                    self.act(action, ctx);
                }
            }
            Action::Undo if self.draws() => self.planner.draw(Edit::Undo),
            Action::Redo if self.draws() => self.planner.draw(Edit::Redo),
            Action::Undo if self.edits_plan() => self.planner.undo(),
            Action::Redo if self.edits_plan() => self.planner.redo(),
            Action::Redo => self.refuse("Only changes of the plan can be redone, while step 2 is open."),
            Action::Undo => match undo_action(&self.shown) {
                Some(Undo::Seed) => self.send("Undo seed", &Request::UndoSeed),
                Some(Undo::Reset) => self.send("Undo reset", &Request::UndoSeed),
                Some(Undo::Plan) => {
                    self.planner.step_back();
                    self.withdraw_plan("Withdraw the plan");
                }
                Some(Undo::Discard) => self.restore_plan(),
                None => {}
            },
            Action::Plan(action) => self.act_on_plan(action),
            Action::RunAll => self.begin_run(Begin::WhereItWas),
            Action::StartOver => self.begin_run(Begin::Anew),
            Action::Answer(is_agreed) => self.answer(is_agreed, ctx),
            Action::PlanSeeds => {
                if let Some(scene) = &self.shown.scene {
                    let plan = self.by_hand(default_plan(scene));
                    self.send("Plan five seeds", &Request::SetPlan(Some(plan.clone())));
                }
            }
            Action::LoadBuiltinScene(number) => self.load_builtin(number),
            Action::PlaceNeedle => {
                // In the tissue the needle keeps its line, because a sideways move would tear it.
                if !self.shown.has_punctured() {
                    self.drive.keep_to_path();
                }
                self.move_to("Place needle", 0.0, self.pace.approach_m_per_s);
            }
            Action::Insert => {
                let depth = self.shown.deepest_seed_m().unwrap_or(0.0);
                self.move_to("Insert", depth, self.pace.insert_m_per_s);
            }
            Action::Retract => self.move_to("Retract", 0.0, self.pace.retract_m_per_s),
            Action::DriveTo(depth) => self.pulled_to_m = Some(depth),
            Action::MoveTo(depth) => self.move_to("Depth", depth, self.pace.insert_m_per_s),
            Action::DropSeed => {
                let strand_pitch_m = self.shown.planning.strand_pitch_m();
                self.send("Drop seed", &Request::DropSeed { strand_pitch_m });
            }
            Action::Send(request) => self.send(request_name(&request), &request),
        }
    }

    /// Sends an empty list of seeds: the plan is withdrawn.
    pub(super) fn withdraw_plan(&mut self, what: &'static str) {
        if let Some(plan) = &self.shown.plan {
            let withdrawn = PlannedNeedle {
                entry_m: plan.entry_m,
                direction: plan.direction,
                seeds_m: Vec::new(),
                prescribed: Default::default(),
            };
            self.send(what, &Request::SetPlan(Some(withdrawn)));
        }
    }

    /// Pulls the tip by hand: at most one goal a frame, and no goal twice.
    fn pull(&mut self) {
        let Some(wanted) = self.pulled_to_m.take() else {
            self.pulled_goal_m = None;
            return;
        };
        let (Some(depth), Some(length)) = (self.shown.path_depth_m(), self.shown.path_length_m()) else {
            return;
        };
        let near = wanted.clamp(depth - PULLED_M, depth + PULLED_M);
        let goal = near.clamp(-BEFORE_ENTRY_M, length);
        if self.pulled_goal_m.is_none_or(|last| (last - goal).abs() > SAME_GOAL_M) {
            self.pulled_goal_m = Some(goal);
            self.move_to("Needle", goal, self.pace.insert_m_per_s);
        }
    }

    /// Stops the script. The needle stays where it is, and the force stays on or off.
    pub(super) fn stop_run(&mut self) {
        self.end_run();
        self.shown.running = false;
        if let Some(tip) = self.shown.tip_on_path() {
            self.drive.stop(&tip);
        }
        self.send("Stop", &Request::StopHand);
    }

    /// Moves the goal along the path while keys, stick or cap are held; releasing stops it there.
    /// Otherwise a hand may pull the tip.
    pub(super) fn drive(&mut self, wish: Wish, frame_s: f64) {
        if self.run.is_some() || self.watches() || !self.shown.is_live() {
            self.drive.forget();
            self.pulled_to_m = None;
            return;
        }
        let Some(tip) = self.shown.tip_on_path() else {
            self.drive = Drive::default();
            self.pulled_to_m = None;
            if wish != Wish::REST {
                let why = "The needle follows the planned path: plan the seeds first.";
                self.refuse(why);
            }
            return;
        };
        self.drive.find(&tip);
        if Drive::follows(&wish, &tip) {
            self.pulled_to_m = None;
            if let Some(goal) = self.drive.step(&wish, &tip, frame_s) {
                self.move_hand("Needle", goal);
            }
        } else if self.drive.stop(&tip) {
            self.send("Needle", &Request::StopHand);
        } else {
            self.pull();
        }
    }

    pub(super) fn send_parameters(&mut self) {
        let Some(pairs) = self.parameters.request() else { return };
        let change = |&(index, value): &(usize, f64)| {
            let spec = PARAMETERS.get(index)?;
            Some(ParameterChange { id: spec.id, value })
        };
        let changes: Vec<_> = pairs.iter().filter_map(change).collect();
        let in_force = self.shown.parameters.map(|p| p.set);
        if let Err(problems) = changed(in_force.unwrap_or_default(), &changes) {
            return self.parameters.refused(pairs, problems.into());
        }
        match self.link.send(&Request::SetParameters(changes)) {
            Ok(id) => self.parameters.sent(id, pairs),
            Err(e) => self.parameters.not_sent(e.to_string()),
        }
    }
}

/// Applies changes by the rules of the core, except for the stiffness limit of its device.
fn changed(mut set: ParameterSet, changes: &[ParameterChange]) -> Result<ParameterSet, ParameterProblems> {
    for change in changes {
        set.set(change.id, change.value);
    }
    ProblemList::check(set.problems()).map(|()| set)
}

/// Returns a name for those requests that panels and keys send as they are.
fn request_name(request: &Request) -> &'static str {
    match request {
        Request::MoveHand(_) => "Needle",
        Request::Engage => "Engage force",
        Request::Disengage => "Disengage",
        Request::Reset => "Reset",
        Request::UndoSeed => "Undo seed",
        Request::LeaveNeedle => "Leave needle",
        Request::TakeNeedle(_) => "Resume needle",
        Request::DrawNeedle { .. } => "Withdraw needle",
        Request::Mark(_) => "Mark",
        Request::BeginExercise(_) => "Exercise",
        Request::EndExercises => "End of exercises",
        _ => "Request",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_shm_schema::{ParameterId, Refusal};

    #[test]
    fn the_window_refuses_what_the_core_would_refuse_and_names_both_angles() {
        let change = |id, value| [ParameterChange { id, value }];
        let set = ParameterSet::default();
        let larger = changed(set, &change(ParameterId::PunctureDepth, 9e-3)).expect("within its limits");
        assert_eq!(larger.get(ParameterId::PunctureDepth), 9e-3);
        let problems = changed(set, &change(ParameterId::ShearVertical, 0.7)).expect_err("eq. 1");
        let reasons = Refusal::from(problems).reasons;
        let named: Vec<_> = reasons.iter().filter_map(|reason| reason.parameter()).collect();
        assert_eq!(named, [ParameterId::ShearHorizontal, ParameterId::ShearVertical]);
    }
}
