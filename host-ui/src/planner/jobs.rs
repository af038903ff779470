//! Background jobs of the planner: a first plan, its strength, compensation, files.

use super::Failure;
use super::outlines::AnatomyOutlines;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};
use stylet_base::interrupt::Interrupt;
use stylet_base::job::Job;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Source};
use stylet_host::link::{Link, SceneModel};
use stylet_implant::intraoperative::Proposed;
use stylet_implant::linked::scene as study;
use stylet_implant::plan::first::{self, FirstPlan};
use stylet_implant::plan::optimise::Objectives;
use stylet_implant::plan::{Compensation, ImplantPlan, Limits, LinkRehearser, Needle, compensate, exchange};
use stylet_implant::workflow::Pace;
use stylet_shm_schema::Instance;

/// Time within which a second host finds the core.
const FIND_LIMIT: Duration = Duration::from_secs(10);
const POLL_EVERY: Duration = Duration::from_millis(5);
/// Number of plans to choose from.
const PROPOSALS: usize = 3;
pub(super) const FIRST_PLAN: &str = "Looking for a first plan";
pub(super) const STUDY: &str = "Writing the DICOM study";

/// Progress of a job, for display.
#[derive(Clone, Debug, PartialEq)]
pub struct JobProgress {
    /// Name of the job.
    pub what: String,
    /// Completed share, 0 to 1, if known.
    pub share: Option<f32>,
}

/// Message from a job.
pub(super) enum JobMessage {
    Progress(JobProgress),
    Plan(Result<ImplantPlan, Failure>),
    /// Proposed plans, with remarks on each.
    First(Vec<FirstPlan>),
    Compensated(Box<(Needle, Compensation)>),
    Update(Result<Box<Proposed>, Failure>),
    /// The last message, in words.
    End(Result<String, Failure>),
}

pub(super) fn automatic(outlines: Arc<AnatomyOutlines>) -> Job<JobMessage> {
    Job::begin("first plan", move |messages, interrupt| {
        let report = |share: f32| {
            let progress = JobProgress {
                what: FIRST_PLAN.to_owned(),
                share: Some(share),
            };
            let _ = messages.send(JobMessage::Progress(progress));
            match interrupt.asked() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let plan = || -> Result<Vec<FirstPlan>, Failure> {
            let (source, prescription_gy) = exchange::usual()?;
            let kernel = DoseKernel::new(&source, Interval::ALL);
            let (template, anatomy) = (outlines.template, &outlines.anatomy);
            let objectives = Objectives::new(&source, prescription_gy);
            Ok(first::proposals(
                template,
                anatomy,
                &kernel,
                &source,
                &objectives,
                PROPOSALS,
                report,
            )?)
        };
        // The window may have closed; the answer is then dropped.
        let _ = messages.send(match plan() {
            Ok(found) => JobMessage::First(found),
            Err(why) => JobMessage::Plan(Err(why)),
        });
    })
}

/// Returns the strength with which the plan covers the target like a first plan.
pub(super) fn strength(outlines: Arc<AnatomyOutlines>, plan: Arc<ImplantPlan>) -> Job<JobMessage> {
    Job::begin("strength", move |messages, _| {
        let scaled = || -> Result<ImplantPlan, Failure> {
            let source = Source::known(&plan.source)
                .ok_or_else(|| format!("source {} is unknown; set the strength by hand", plan.source))?;
            let kernel = DoseKernel::new(&source, Interval::ALL);
            let strength_u = first::strength_u(&plan, &outlines.anatomy, &kernel)?;
            Ok(plan.with_strength(strength_u))
        };
        let _ = messages.send(JobMessage::Plan(scaled()));
    })
}

pub(super) fn import(path: PathBuf, scene: Arc<SceneModel>, scene_file: Option<PathBuf>) -> Job<JobMessage> {
    Job::begin("plan reader", move |messages, _| {
        let plan = exchange::read(&path, &scene.header, scene_file.as_deref()).map_err(Failure::from);
        let _ = messages.send(JobMessage::Plan(plan));
    })
}

pub(super) fn export(
    path: PathBuf,
    plan: Arc<ImplantPlan>,
    outlines: Arc<AnatomyOutlines>,
    scene_file: Option<PathBuf>,
) -> Job<JobMessage> {
    Job::begin("plan writer", move |messages, _| {
        let written = exchange::write(&path, &plan, &outlines.frames, scene_file.as_deref());
        let saved = written.map(|()| format!("Plan saved as {}", path.display()));
        let _ = messages.send(JobMessage::End(saved.map_err(Failure::from)));
    })
}

/// Writes structure set, plan and dose of one study.
pub(super) fn study(
    folder: PathBuf,
    plan: Arc<ImplantPlan>,
    (scene, outlines): (Arc<SceneModel>, Arc<AnatomyOutlines>),
    like: Option<PathBuf>,
) -> Job<JobMessage> {
    Job::begin("study writer", move |messages, interrupt| {
        let report = |share: f32| {
            let progress = JobProgress {
                what: STUDY.to_owned(),
                share: Some(share),
            };
            let _ = messages.send(JobMessage::Progress(progress));
            match interrupt.asked() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let written = study::write(&folder, &plan, (&scene, &outlines.anatomy), like.as_deref(), &report);
        let end = match written {
            Ok(notes) if notes.is_empty() => Ok(format!("Study saved as {}", folder.display())),
            Ok(notes) => Ok(format!("Study saved as {}: {}", folder.display(), notes.join("; "))),
            Err(why) => Err(Failure::from(why)),
        };
        let _ = messages.send(JobMessage::End(end));
    })
}

/// Compensates one needle after the other, through a separate link: the window keeps its own.
pub(super) fn compensation(instance: Instance, needles: Vec<Needle>, pace: Pace) -> Job<JobMessage> {
    Job::begin("compensation", move |messages, interrupt| {
        let end = all(instance, &needles, &pace, messages, interrupt);
        let _ = messages.send(JobMessage::End(end));
    })
}

fn all(
    instance: Instance,
    needles: &[Needle],
    pace: &Pace,
    messages: &Sender<JobMessage>,
    interrupt: &Interrupt,
) -> Result<String, Failure> {
    let mut link = Link::new(instance);
    let begun = Instant::now();
    while link.scene().is_none() || link.state().is_none() {
        if interrupt.asked() || begun.elapsed() > FIND_LIMIT {
            return Err("rt-core does not answer; check that it is running".into());
        }
        link.poll();
        std::thread::sleep(POLL_EVERY);
    }
    let mut failed = Vec::new();
    for (number, needle) in needles.iter().enumerate() {
        let name = needle.hole.map_or_else(|| format!("{}", number + 1), |h| h.to_string());
        let progress = JobProgress {
            what: format!("Rehearsing needle {} of {}, {name}", number + 1, needles.len()),
            share: Some(number as f32 / needles.len() as f32),
        };
        let _ = messages.send(JobMessage::Progress(progress));
        let mut rehearser = LinkRehearser {
            stabilising: &[],
            earlier: &[],
            link: &mut link,
            interrupted: interrupt,
        };
        match compensate(needle, pace, &Limits::default(), &mut rehearser) {
            Ok(done) => drop(messages.send(JobMessage::Compensated(Box::new((needle.clone(), done))))),
            Err(_) if interrupt.asked() => return Err("the compensation was cancelled".into()),
            Err(why) => failed.push(format!("needle {name}: {why}")),
        }
    }
    match failed.as_slice() {
        [] => Ok(format!("{} needles compensated.", needles.len())),
        _ => Err(format!("Not compensated: {}", failed.join("; ")).into()),
    }
}
