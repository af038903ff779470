//! The plan that is edited in the window: its history, its problems, its background jobs, and the
//! progress of its needles.
//!
//! Each frame passes new data in and takes the state for display; nothing here takes longer than a
//! copy of the plan.

mod edit;
mod jobs;
mod kept;
mod needles;
mod outlines;
mod review;
mod shown;

use jobs::JobMessage;
#[cfg(test)]
pub(crate) use jobs::JobProgress;
use kept::{Aside, KeptPlan};
pub(crate) use needles::NeedleProgress;
pub use needles::NeedleState;
pub(crate) use outlines::{AnatomyOutlines, Outline};
#[cfg(test)]
pub(crate) use review::Drawn;
use review::Review;
pub(crate) use review::{Edit, ReviewShown};
pub(crate) use shown::{Implant, Planning};
use std::path::PathBuf;
use std::sync::Arc;
use stylet_base::job::{Job, JobUpdate};
use stylet_host::link::SceneModel;
use stylet_implant::plan::check::{Problem, problems};
use stylet_implant::plan::{Compensation, Drops, History, ImplantPlan, Needle, Template};
use stylet_implant::workflow::NeedleTask;
use stylet_shm_schema::SceneId;
use web_time::Instant;

/// Any error, shown as text.
type Failure = Box<dyn std::error::Error + Send + Sync>;
type Checked = Job<Vec<Problem>>;
/// Session and generation of the scene, the template, and the job that computes their outlines.
type OutlinesJob = (SceneId, Template, Job<Result<AnatomyOutlines, Failure>>);

/// Message for the operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// True for a refusal or a failure, with its reason.
    pub refused: bool,
    /// Text of the message.
    pub text: String,
}

impl Note {
    /// Reports a success.
    pub fn done(text: String) -> Self {
        Self { refused: false, text }
    }

    /// Reports a refusal or a failure.
    pub fn refusal(why: impl ToString) -> Self {
        Self {
            refused: true,
            text: why.to_string(),
        }
    }
}

/// Plan of many needles and its background jobs.
#[derive(Default)]
pub struct Planner {
    /// State that a frame shows.
    planning: Planning,
    outlining: Option<OutlinesJob>,
    /// Scene and template whose outlines could not be computed.
    failed: Option<(SceneId, Template)>,
    /// Scene of the plan: its name and box.
    of_scene: Option<(String, [f64; 3])>,
    history: Option<History<ImplantPlan>>,
    /// Number that grows with each visible change.
    revision: u64,
    problems: Option<Arc<Vec<Problem>>>,
    checking: Option<(u64, Checked)>,
    checked: u64,
    job: Option<Job<JobMessage>>,
    /// Folder in which the plan is kept for another window; none if not given.
    kept_in: Option<PathBuf>,
    /// True if plan or compensation changed since the file was last written, and the writing of it.
    to_keep: bool,
    keeping: Option<Job<()>>,
    /// Plans that were discarded or belong to another scene, at most one for each scene.
    aside: Vec<Aside>,
    /// Digest of the body for which needles were compensated, and the run of the core.
    body: Option<(u64, u64)>,
    /// Scene for which a kept plan was looked for, and the search.
    looked: Option<(SceneId, Job<KeptPlan>)>,
    /// Needles at their rehearsal, with their compensation.
    compensated: Vec<(Needle, Compensation)>,
    review: Review,
    /// Needle whose seeds were changed last, and the time.
    drawn: Option<(usize, Instant)>,
    shown_revision: u64,
    /// Message for the operator, reported once.
    message: Option<Note>,
}

impl Planner {
    /// Returns the plan, where there is one.
    pub fn plan(&self) -> Option<&ImplantPlan> {
        self.history.as_ref().map(History::now)
    }

    /// Returns the progress of its needles.
    pub fn progress(&self) -> &NeedleProgress {
        &self.planning.progress
    }

    /// Returns a message for the operator, reported once.
    pub fn take_message(&mut self) -> Option<Note> {
        self.message.take()
    }

    fn refuse(&mut self, why: impl ToString) {
        self.message = Some(Note::refusal(why));
    }

    /// Returns the state that a frame shows.
    pub fn planning(&self) -> Planning {
        Planning {
            review: self.review.shown(self.can_withdraw()),
            can_restore: self.can_restore(),
            ..self.planning.clone()
        }
    }

    /// Takes the data that arrived since the last frame.
    pub fn take(&mut self, scene: Option<&Arc<SceneModel>>, seeds: usize) {
        let Some(scene) = scene else { return };
        self.take_scene(scene);
        self.take_kept();
        self.take_job();
        self.take_problems();
        if self.planning.progress.is_undone(seeds) {
            self.restart();
        }
        self.advance(|progress| progress.take(seeds));
        self.write_kept();
        self.show();
    }

    fn show(&mut self) {
        if self.shown_revision != self.revision {
            self.shown_revision = self.revision;
            self.planning.implant = self.history.as_ref().map(|history| {
                let checked = self.problems.clone().filter(|_| self.checked == self.revision);
                let old = self.planning.implant.as_ref().and_then(|i| i.problems.clone());
                Arc::new(Implant::of(
                    self.revision,
                    history,
                    checked.or(old),
                    &self.planning.progress,
                    &self.compensated,
                ))
            });
        }
    }

    /// Keeps rehearsals in a body of the same labels, also under another core, whose tissue model is not known here.
    fn meet_body(&mut self, body: u64, core: u64) {
        let before = self.body.replace((body, core));
        if before.map(|(body, _)| body) != Some(body) {
            self.compensated.clear();
        } else if before != self.body && !self.compensated.is_empty() {
            self.message = Some(Note::done(
                "The rehearsals are from the previous core. Compensate again if this one has other settings."
                    .to_owned(),
            ));
        }
    }

    fn take_scene(&mut self, scene: &Arc<SceneModel>) {
        let key = scene.header.id();
        let of_scene = (scene.header.name.read(), scene.header.upper_m);
        if self.of_scene.as_ref() != Some(&of_scene) {
            if self.history.is_some() {
                self.message = Some(Note::done(
                    "The plan was set aside: it returns with its scene.".to_owned(),
                ));
            }
            self.set_aside();
            *self = Self {
                of_scene: Some(of_scene),
                message: self.message.take(),
                revision: self.revision + 1,
                kept_in: self.kept_in.take(),
                aside: std::mem::take(&mut self.aside),
                ..Self::default()
            };
            // The tissue is new, whatever was in that of before.
            if self.restore() {
                self.count_none();
            }
        }
        if let Some((key, template, job)) = &self.outlining {
            let (key, template) = (*key, *template);
            match job.poll() {
                JobUpdate::Pending => {}
                JobUpdate::Message(Ok(outlines)) => {
                    self.meet_body(outlines.body, outlines.scene.session_id);
                    self.planning.outlines = Some(Arc::new(outlines));
                    self.outlining = None;
                    self.change();
                }
                JobUpdate::Message(Err(why)) => self.no_outlines(key, template, &why.to_string()),
                JobUpdate::Ended => self.no_outlines(key, template, "its anatomy could not be determined"),
            }
            return;
        }
        let template = self
            .plan()
            .map_or_else(|| Template::before(&scene.header), |p| p.template);
        let is_known = |g: &Arc<AnatomyOutlines>| g.scene == key && g.template == template;
        if !self.planning.outlines.as_ref().is_some_and(is_known) && self.failed != Some((key, template)) {
            if self.planning.outlines.as_ref().is_some_and(|g| g.scene != key) {
                self.count_none();
            }
            let model = scene.clone();
            let job = Job::begin("anatomy", move |messages, _| {
                let _ = messages.send(AnatomyOutlines::of(&model, template));
            });
            self.outlining = Some((key, template, job));
        }
    }

    fn no_outlines(&mut self, key: SceneId, template: Template, why: &str) {
        (self.planning.outlines, self.outlining, self.failed) = (None, None, Some((key, template)));
        self.refuse(format!("No plan can be made for this scene: {why}"));
    }

    fn take_problems(&mut self) {
        if let Some((revision, job)) = &self.checking {
            match job.poll() {
                JobUpdate::Pending => return,
                JobUpdate::Message(found) => {
                    self.problems = Some(Arc::new(found));
                    self.checked = *revision;
                    let is_new = *revision == self.revision;
                    self.checking = None;
                    if is_new {
                        self.shown_revision = 0;
                        self.to_keep = true;
                    }
                }
                JobUpdate::Ended => self.checking = None,
            }
        }
        let (Some(outlines), Some(plan)) = (&self.planning.outlines, self.plan()) else {
            return;
        };
        if self.checked == self.revision || self.checking.is_some() {
            return;
        }
        let (outlines, plan) = (outlines.clone(), plan.clone());
        let job = Job::begin("plan check", move |messages, _| {
            let _ = messages.send(problems(&plan, &outlines.anatomy));
        });
        self.checking = Some((self.revision, job));
    }

    fn take_job(&mut self) {
        let Some(job) = &self.job else { return };
        let mut news = job.poll();
        // Of several messages about progress only the last counts.
        while let JobUpdate::Message(JobMessage::Progress(now)) = news {
            self.planning.job = Some(now);
            news = job.poll();
        }
        let message = match news {
            JobUpdate::Pending => return,
            JobUpdate::Ended => return self.cancel(),
            JobUpdate::Message(message) => message,
        };
        if let JobMessage::Compensated(done) = message {
            self.compensated.retain(|(needle, _)| *needle != done.0);
            self.compensated.push(*done);
            self.to_keep = true;
            return self.refresh();
        }
        self.cancel();
        match message {
            JobMessage::Plan(plan, notes) => match self.can_be(plan) {
                Ok(plan) => {
                    self.put(plan);
                    self.message = plan_message("The plan was read", &notes);
                }
                Err(why) => self.refuse(why),
            },
            JobMessage::First(found) => {
                self.planning.proposals = Some(Arc::new(found));
                self.choose(0);
            }
            JobMessage::Update(found) => self.take_update(*found),
            JobMessage::End(text) => self.message = Some(Note::done(text)),
            JobMessage::Failed(why) => self.refuse(why),
            JobMessage::Progress(_) | JobMessage::Compensated(_) => {}
        }
    }

    /// Publishes a visible change.
    fn refresh(&mut self) {
        self.shown_revision = 0;
    }

    fn advance(&mut self, advance: impl FnOnce(&mut NeedleProgress)) {
        let before = self.planning.progress.clone();
        advance(&mut self.planning.progress);
        if self.planning.progress != before {
            self.to_keep = true;
            self.refresh();
        }
    }

    /// Returns path and drops of a needle.
    pub fn task(&self, number: usize) -> Option<NeedleTask> {
        let plan = self.plan()?;
        let needle = plan.needles.get(number)?;
        let found = self.compensated.iter().find(|(n, _)| n == needle);
        let drops = found.map_or_else(|| Drops::as_planned(needle), |(_, done)| done.drops.clone());
        NeedleTask::of(plan, number, drops)
    }

    /// Returns the next needle that has seeds.
    pub fn next_needle(&self) -> Option<usize> {
        self.planning().next_needle()
    }

    /// Returns all needles with seeds, each with its number.
    pub fn tasks(&self) -> Vec<(usize, NeedleTask)> {
        let needles = self.plan().map_or(&[][..], |p| &p.needles[..]).iter().enumerate();
        let loaded = needles.filter(|(_, n)| !n.seeds.is_empty());
        loaded
            .filter_map(|(number, _)| Some((number, self.task(number)?)))
            .collect()
    }

    /// Marks a needle as being inserted, with this number of seeds in the tissue.
    pub fn begin_needle(&mut self, number: usize, seeds: usize) {
        self.advance(|progress| progress.begin(number, seeds));
    }

    /// Marks the inserted needle as done, with this number of seeds in the tissue.
    pub fn finish_needle(&mut self, seeds: usize) {
        self.advance(|progress| progress.finish(seeds));
    }

    /// Takes the drops of a script that left no seed, counted from 0 over all needles.
    pub fn take_lost(&mut self, lost: &[usize]) {
        self.advance(|progress| progress.lost = lost.to_vec());
    }

    /// Marks the inserted needle as planned again.
    pub fn step_back(&mut self) {
        self.advance(NeedleProgress::step_back);
    }

    /// Restarts the implantation: no needle is inserted.
    pub fn restart(&mut self) {
        self.review.restart();
        self.count_none();
    }

    /// Marks no needle as inserted, in an implantation that continues: its updates are kept.
    pub fn count_none(&mut self) {
        self.advance(|progress| *progress = NeedleProgress::default());
    }
}

/// Returns a message with the remarks on a plan.
fn plan_message(what: &str, notes: &[String]) -> Option<Note> {
    (!notes.is_empty()).then(|| Note::done(format!("{what}: {}.", notes.join("; "))))
}

#[cfg(test)]
pub(crate) mod tests;
