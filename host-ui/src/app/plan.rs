//! Executes the operator's requests in a plan of many needles.

use super::App;
use super::debrief::folder_of;
use super::drive::Drive;
use crate::action::PlanAction;
use crate::panel::question::{Begin, Question};
use crate::panel::workflow::Progress;
use crate::settings::Layout;
use nalgebra::Vector3;
use std::path::PathBuf;
use stylet_implant::plan::{ImplantPlan, exchange};
use stylet_implant::workflow::{NeedleTask, Placed, Run, default_plan};
use stylet_shm_schema::{PlannedNeedle, Prescribed, Request, Text};
use web_time::{Duration, Instant};

/// Period of the search for placed seeds, which compares every planned drop with every seed.
const FIND_PLACED_EVERY: Duration = Duration::from_millis(300);

/// Part of the plan that a script inserts.
#[derive(Default)]
pub(super) struct Script {
    /// Needles of the plan.
    pub needles: Vec<usize>,
    /// Needles and seeds in the tissue when the script began or continued.
    pub placed: Placed,
}

impl Script {
    /// Returns number and count of needles as the plan counts them, also those without seeds; `None` for one needle.
    pub fn in_plan(&self, at: usize, plan: Option<&ImplantPlan>) -> Option<(usize, usize)> {
        let (number, plan) = (self.needles.get(at)?, plan?);
        (self.needles.len() > 1).then_some((*number, plan.needles.len()))
    }
}

impl App {
    /// Returns whether undo acts on the plan, which it does while the plan is edited.
    pub(super) fn edits_plan(&self) -> bool {
        self.shown.planning.implant.is_some() && self.workflow.is_open(Progress::Plan)
    }

    /// Returns whether clicks on the live picture draw.
    pub(super) fn draws(&self) -> bool {
        self.settings.layout == Layout::Probe && self.middle.view.tool.is_some()
    }

    pub(super) fn take_plan(&mut self) {
        // Before the first snapshot nothing tells that seeds were removed.
        let seeds = self.link.snapshot().map_or(usize::MAX, |_| self.shown.seeds.len());
        self.planner.take(self.link.scene(), seeds);
        if let (true, Some(scene), Some(snapshot)) = (self.draws(), self.link.scene(), self.link.snapshot()) {
            self.planner.take_review(scene, snapshot);
        }
        self.shown.note = self.planner.take_message().or(self.shown.note.take());
        self.shown.planning = self.planner.planning();
        if self.run.is_none() && crate::panel::workflow::is_needle_done(&self.shown) {
            self.planner.finish_needle(self.shown.seeds.len());
        }
    }

    pub(super) fn act_on_plan(&mut self, action: PlanAction) {
        if !matches!(
            action,
            PlanAction::Export(_) | PlanAction::ExportStudy | PlanAction::LookAt(_) | PlanAction::Draw(_)
        ) {
            self.shown.note = None;
        }
        let scene_file = self.scene_file();
        let planner = &mut self.planner;
        match action {
            PlanAction::Begin => planner.begin(),
            PlanAction::Automatic => planner.automatic(),
            PlanAction::Choose(number) => planner.choose(number),
            PlanAction::Discard => {
                planner.discard();
                self.withdraw_plan("Discard the plan");
            }
            PlanAction::Restore => self.restore_plan(),
            PlanAction::Add(hole) => planner.add(hole, self.settings.seed_strength_u),
            PlanAction::Remove(needle) => planner.edit(|plan| plan.without_needle(needle)),
            PlanAction::Move(needle, hole) => planner.edit(|plan| plan.with_needle_at(needle, hole)),
            PlanAction::SetRow(needle, row) => planner.set_row(needle, row),
            PlanAction::SetStrength(strength_u) => planner.edit(|plan| Ok::<_, String>(plan.with_strength(strength_u))),
            PlanAction::FitStrength => planner.fit_strength(),
            PlanAction::Compensate => planner.compensate(self.link.instance().clone(), self.pace),
            PlanAction::Cancel => planner.cancel(),
            PlanAction::Import(path) => {
                if let Some(scene) = self.link.scene() {
                    planner.import(path, scene.clone(), scene_file);
                }
            }
            PlanAction::Export(path) if path.exists() && self.workflow.plan.own_file.as_ref() != Some(&path) => {
                self.question = Some(Question::Replace(path));
            }
            PlanAction::Export(path) => {
                self.workflow.plan.own_file = Some(path.clone());
                planner.export(path, scene_file, None);
            }
            PlanAction::ExportStudy => {
                if let Some(scene) = self.link.scene() {
                    let folder = folder_of("study");
                    planner.export_study(folder, scene.clone(), scene_file);
                }
            }
            PlanAction::NextNeedle => self.next_needle(),
            PlanAction::LookAt(depth_m) => self.look_at(depth_m),
            PlanAction::Draw(edit) => planner.draw(edit),
            PlanAction::SeedsFrom(which) => planner.set_seeds_from(which),
            PlanAction::Update => planner.update(self.link.scene(), self.link.snapshot()),
            PlanAction::Decide(accept) => planner.decide(accept),
            PlanAction::WithdrawUpdate => planner.withdraw_update(),
        }
    }

    /// Returns the file of the present scene, if this window loaded it.
    pub(super) fn scene_file(&self) -> Option<PathBuf> {
        // Another window may have loaded another scene since.
        let scene = &self.link.scene()?.header;
        let file = self.files.scene_file.as_ref().filter(|file| file.is(scene));
        file.map(|file| file.path.clone())
    }

    fn next_needle(&mut self) {
        let Some(number) = self.planner.next_needle() else {
            return;
        };
        self.planner.begin_needle(number, self.shown.seeds.len());
        self.publish("Next needle", number);
    }

    fn publish(&mut self, what: &'static str, needle: usize) {
        let Some(task) = self.planner.task(needle) else { return };
        let mut plan = task.plan;
        // Compensation may shift the entry a little from the hole.
        plan.entry_m = task.drops.entry_m;
        self.send(what, &Request::SetPlan(Some(plan)));
    }

    /// Restores the plan that was discarded, and the path of its needle at work.
    pub(super) fn restore_plan(&mut self) {
        if self.planner.restore()
            && let Some(number) = self.planner.progress().begun().checked_sub(1)
        {
            self.publish("Restore the plan", number);
        }
    }

    /// Moves the axial slice to the plane that the template shows.
    fn look_at(&mut self, depth_m: f64) {
        let Some(outlines) = &self.shown.planning.outlines else {
            return;
        };
        let inwards = Vector3::from(outlines.template.inwards);
        let view = &mut self.middle.view;
        let off_m = (view.cursor_m - Vector3::from(outlines.template.middle_m)).dot(&inwards);
        view.leave_tip();
        view.cursor_m += inwards * (depth_m - off_m);
    }

    /// Returns the part of the plan that is in the tissue.
    fn placed(&self, tasks: &[NeedleTask]) -> Placed {
        let dropped_at_m: Vec<[f64; 3]> = self.shown.seeds.iter().map(|seed| seed.dropped_at_m).collect();
        let lost = &self.planner.progress().lost;
        Placed::find(tasks, &dropped_at_m, self.shown.tip_m(), lost)
    }

    /// Updates whether the script can continue, checked now and then while it rests.
    pub(super) fn find_placed(&mut self) {
        if self.run.is_some() || self.shown.seeds.is_empty() {
            self.shown.continues_at = None;
        } else if self.placed_found.elapsed() >= FIND_PLACED_EVERY {
            self.placed_found = Instant::now();
            let (numbers, tasks): (Vec<usize>, Vec<NeedleTask>) = self.planner.tasks().into_iter().unzip();
            let placed = self.placed(&tasks);
            let next = numbers.get(placed.next_needle()).filter(|_| placed.is_partial());
            let count = self.planner.plan().map_or(0, |plan| plan.needles.len());
            self.shown.continues_at = next.map(|number| (*number, count));
            // Seeds that undoing a reset restored, or those of a plan that was imported again.
            if placed.has_begun() && self.planner.progress().begun() == 0 {
                self.mark_placed(&numbers, &placed);
            }
        }
    }

    /// Marks the needles before the next one as done, and the next one as inserted if it has begun.
    fn mark_placed(&mut self, numbers: &[usize], placed: &Placed) {
        let mut before = 0;
        for (at, &number) in numbers.iter().enumerate().take(placed.next_needle()) {
            self.planner.begin_needle(number, before);
            before += placed.seeds_of(at);
            self.planner.finish_needle(before);
        }
        let next = placed.next_needle();
        if let Some(&number) = numbers.get(next).filter(|_| placed.is_begun(next)) {
            self.planner.begin_needle(number, before);
        }
    }

    /// Begins a run, or asks first if a fault stands: only a person re-arms.
    pub(super) fn begin_run(&mut self, begin: Begin) {
        if self.shown.stands_fault().is_some() {
            self.question = Some(Question::Rearm(begin));
            return;
        }
        match begin {
            Begin::WhereItWas => self.run_all(),
            Begin::Anew => self.start_over(),
        }
    }

    pub(super) fn rearm(&mut self, begin: Begin) {
        match begin {
            Begin::WhereItWas => self.run_all(),
            Begin::Anew => self.start_over(),
        }
        self.run = self.run.take().map(Run::rearming);
    }

    /// Continues the plan from the state of the tissue, or begins it if nothing is placed.
    fn run_all(&mut self) {
        let (numbers, tasks): (Vec<usize>, Vec<NeedleTask>) = self.planner.tasks().into_iter().unzip();
        let placed = self.placed(&tasks);
        if self.planner.is_busy() || !placed.is_partial() {
            return self.start_over();
        }
        self.planner.count_none();
        self.mark_placed(&numbers, &placed);
        self.run = Some(Run::continuing(tasks, self.pace, &placed));
        (self.script.needles, self.script.placed) = (numbers, placed);
        self.drive = Drive::default();
    }

    pub(super) fn end_run(&mut self) {
        (self.run, self.shown.run_waits, self.placed_found) = (None, None, Instant::now());
    }

    /// Starts over: all needles of the plan from a reset, or one needle through the middle without
    /// a plan.
    fn start_over(&mut self) {
        self.script.placed = Placed::default();
        if self.planner.is_busy() {
            self.refuse("Wait for the running task, or cancel it first.");
            return;
        }
        let tasks = self.planner.tasks();
        if !tasks.is_empty() {
            self.planner.restart();
            let (numbers, tasks) = tasks.into_iter().unzip();
            self.script.needles = numbers;
            self.run = Some(Run::of_needles(tasks, self.pace));
            self.drive = Drive::default();
        } else if let Some(scene) = &self.shown.scene {
            self.script.needles.clear();
            self.run = Some(Run::new(self.by_hand(default_plan(scene)), self.pace));
            self.drive = Drive::default();
        }
    }

    /// Returns a needle by hand with the seeds of the settings.
    pub(super) fn by_hand(&self, plan: PlannedNeedle) -> PlannedNeedle {
        let Ok((source, dose_gy)) = exchange::usual() else {
            return plan;
        };
        let prescribed = Prescribed {
            strength_u: self.settings.seed_strength_u,
            dose_gy,
            source: Text::new(&source.model),
            ..Default::default()
        };
        PlannedNeedle { prescribed, ..plan }
    }

    /// Advances the plan's progress with the script.
    pub(super) fn follow_run(&mut self, at: usize, is_done: bool) {
        let Some(&number) = self.script.needles.get(at) else {
            return;
        };
        let progress = self.planner.progress();
        if progress.begun() != number + 1 {
            let begins = at == 0 && self.script.placed == Placed::default();
            let seeds = if begins { 0 } else { self.shown.seeds.len() };
            // Seeds that were placed before the script continued belong to this needle.
            let seeds = seeds.saturating_sub(self.script.placed.seeds_of(at));
            self.planner.begin_needle(number, seeds);
        }
        if is_done {
            self.planner.finish_needle(self.shown.seeds.len());
        }
    }
}
