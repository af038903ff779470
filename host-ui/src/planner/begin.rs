//! Requests for background jobs; each is refused while another runs.

use super::jobs::{self, JobMessage, JobProgress};
use super::outlines::AnatomyOutlines;
use super::{Failure, Message, Planner, plan_message};
use std::path::PathBuf;
use std::sync::Arc;
use stylet_base::job::Job;
use stylet_host::link::SceneModel;
use stylet_implant::plan::Needle;
use stylet_implant::workflow::Pace;
use stylet_shm_schema::Instance;

impl Planner {
    /// Returns whether a job runs.
    pub fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// Cancels the job.
    pub fn cancel(&mut self) {
        self.job = None;
    }

    pub(super) fn begin_job(
        &mut self,
        what: &str,
        begin: impl FnOnce(&Self, Arc<AnatomyOutlines>) -> Result<Job<JobMessage>, Failure>,
    ) {
        let job = match (&self.outlines, self.is_busy()) {
            (_, true) => return,
            (None, _) => Err("the scene's anatomy is not ready yet; try again in a moment".into()),
            (Some(outlines), false) => begin(self, outlines.clone()),
        };
        match job {
            Ok(job) => {
                let progress = JobProgress {
                    what: what.to_owned(),
                    share: None,
                };
                self.job = Some((job, progress));
            }
            Err(why) => self.message = Some(Message::Refused(why.to_string())),
        }
    }

    /// Starts a search for a first plan.
    pub fn automatic(&mut self) {
        self.begin_job(jobs::FIRST_PLAN, |_, outlines| Ok(jobs::automatic(outlines)));
    }

    /// Takes one of the proposals of the last search.
    pub fn choose(&mut self, number: usize) {
        let Some(proposals) = self.proposals.clone().filter(|_| !self.is_busy()) else {
            return;
        };
        let Some(found) = proposals.get(number) else { return };
        match self.can_be(found.found.plan.clone()) {
            Ok(plan) => {
                self.put(plan);
                self.message = plan_message(&found.notes);
            }
            Err(why) => self.message = Some(Message::Refused(why.to_string())),
        }
    }

    /// Starts to fit the strength of the seeds to the dose of the target.
    pub fn fit_strength(&mut self) {
        self.begin_job("Fitting the strength", |planner, outlines| {
            Ok(jobs::strength(outlines, Arc::new(planner.planned()?.clone())))
        });
    }

    /// Starts to read a plan from a file.
    pub fn import(&mut self, path: PathBuf, scene: Arc<SceneModel>, scene_file: Option<PathBuf>) {
        self.begin_job("Reading the plan", |_, _| Ok(jobs::import(path, scene, scene_file)));
    }

    /// Starts to write the plan to a file.
    pub fn export(&mut self, path: PathBuf, scene_file: Option<PathBuf>) {
        self.begin_job("Writing the plan", |planner, outlines| {
            Ok(jobs::export(
                path,
                Arc::new(planner.planned()?.clone()),
                outlines,
                scene_file,
            ))
        });
    }

    /// Starts to write structure set, plan and dose. Patient and frame come from `like` if it is a
    /// DICOM file.
    pub fn export_study(&mut self, folder: PathBuf, scene: Arc<SceneModel>, like: Option<PathBuf>) {
        self.begin_job(jobs::STUDY, |planner, outlines| {
            let plan = Arc::new(planner.planned()?.clone());
            Ok(jobs::study(folder, plan, (scene, outlines), like))
        });
    }

    /// Compensates the needles that are not inserted yet.
    pub fn compensate(&mut self, instance: Instance, pace: Pace) {
        self.begin_job("Rehearsing", |planner, _| {
            let begun = planner.progress.begun();
            let left = planner.planned()?.needles.iter().skip(begun);
            let needles: Vec<Needle> = left.filter(|n| !n.seeds.is_empty()).cloned().collect();
            if needles.is_empty() {
                return Err("no needle with seeds is left to rehearse".into());
            }
            Ok(jobs::compensation(instance, needles, pace))
        });
    }
}
