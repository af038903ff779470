//! Background jobs of the planner: a first plan, its strength, compensation, files. Each is refused while another runs.

use super::outlines::AnatomyOutlines;
use super::{Failure, Planner, plan_message};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use stylet_base::format;
use stylet_base::interrupt::Interrupt;
use stylet_base::job::Job;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Source};
use stylet_host::link::{Link, SceneModel};
use stylet_implant::intraoperative::Reviewed;
use stylet_implant::linked::scene as study;
use stylet_implant::plan::first::{self, FirstPlan};
use stylet_implant::plan::optimise::{self, Objectives};
use stylet_implant::plan::{Compensation, ImplantPlan, Limits, LinkRehearser, Needle, compensate, exchange};
use stylet_implant::workflow::Pace;
use stylet_shm_schema::Instance;
use web_time::{Duration, Instant};

/// Time within which a second host finds the core.
const FIND_LIMIT: Duration = Duration::from_secs(10);
const POLL_EVERY: Duration = Duration::from_millis(5);
/// Number of plans to choose from.
const PROPOSALS: usize = 3;

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
    /// A plan, with remarks.
    Plan(ImplantPlan, Vec<String>),
    /// Proposed plans, with remarks on each.
    First(Vec<FirstPlan>),
    Compensated(Box<(Needle, Compensation)>),
    Update(Box<Reviewed>),
    /// The last message, in words.
    End(String),
    Failed(Failure),
}

/// Tells the window how far a job is.
pub(super) struct Reporter<'a> {
    what: &'static str,
    messages: &'a Sender<JobMessage>,
    interrupt: &'a Interrupt,
}

impl Reporter<'_> {
    // The window may have closed; a message is then dropped.
    fn send(&self, message: JobMessage) {
        let _ = self.messages.send(message);
    }

    fn is_at(&self, what: String, share: f32) {
        let share = Some(share);
        self.send(JobMessage::Progress(JobProgress { what, share }));
    }

    /// Reports the completed share; breaks off if the job was cancelled.
    pub fn report(&self, share: f32) -> ControlFlow<()> {
        self.is_at(self.what.to_owned(), share);
        match self.interrupt.asked() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

impl Planner {
    /// Returns whether a job runs.
    pub fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// Cancels the job.
    pub fn cancel(&mut self) {
        (self.job, self.planning.job) = (None, None);
    }

    /// Begins a job, whose work `prepare` returns; it ends with one message.
    pub(super) fn begin_job<W>(
        &mut self,
        what: &'static str,
        prepare: impl FnOnce(&Self, Arc<AnatomyOutlines>) -> Result<W, Failure>,
    ) where
        W: FnOnce(&Reporter<'_>) -> Result<JobMessage, Failure> + Send + 'static,
    {
        let work = match (&self.planning.outlines, self.is_busy()) {
            (_, true) => return,
            (None, _) => Err("The scene's anatomy is not ready yet; try again in a moment.".into()),
            (Some(outlines), false) => prepare(self, outlines.clone()),
        };
        match work {
            Ok(work) => {
                let job = Job::begin("plan", move |messages, interrupt| {
                    let reporter = Reporter {
                        what,
                        messages,
                        interrupt,
                    };
                    reporter.send(work(&reporter).unwrap_or_else(JobMessage::Failed));
                });
                self.planning.job = Some(JobProgress {
                    what: what.to_owned(),
                    share: None,
                });
                self.job = Some(job);
            }
            Err(why) => self.refuse(why),
        }
    }

    /// Starts a search for a first plan.
    pub fn automatic(&mut self) {
        self.begin_job("Searching for a plan", |_, outlines| {
            Ok(move |reporter: &Reporter<'_>| {
                let (source, prescription_gy) = exchange::usual()?;
                let kernel = DoseKernel::new(&source, Interval::ALL);
                let objectives = Objectives::new(&source, prescription_gy);
                let report = |share| reporter.report(share);
                let (template, anatomy) = (outlines.template, &outlines.anatomy);
                // Without a urethra there is little to choose between, and the window's steps need the room.
                let [_, urethra, _] = optimise::bodies(anatomy);
                let count = if urethra.is_some() { PROPOSALS } else { 1 };
                let found = first::proposals(template, anatomy, &kernel, &source, &objectives, count, report)?;
                Ok(JobMessage::First(found))
            })
        });
    }

    /// Takes one of the proposals of the last search.
    pub fn choose(&mut self, number: usize) {
        let Some(proposals) = self.planning.proposals.clone().filter(|_| !self.is_busy()) else {
            return;
        };
        let Some(found) = proposals.get(number) else { return };
        match self.can_be(found.found.plan.clone()) {
            Ok(plan) => {
                self.put(plan);
                self.message = plan_message("Automatic plan", &found.notes);
            }
            Err(why) => self.refuse(why),
        }
    }

    /// Starts to fit the strength of the seeds, so that the plan covers the target like a first plan.
    pub fn fit_strength(&mut self) {
        self.begin_job("Fitting the strength", |planner, outlines| {
            let plan = planner.planned()?.clone();
            Ok(move |_: &Reporter<'_>| {
                let source = Source::known(&plan.source)
                    .ok_or_else(|| format!("Source {} is unknown; set the strength by hand.", plan.source))?;
                let kernel = DoseKernel::new(&source, Interval::ALL);
                let strength_u = first::strength_u(&plan, &outlines.anatomy, &kernel)?;
                Ok(JobMessage::Plan(plan.with_strength(strength_u), Vec::new()))
            })
        });
    }

    /// Starts to read a plan from a file.
    pub fn import(&mut self, path: PathBuf, scene: Arc<SceneModel>, scene_file: Option<PathBuf>) {
        self.begin_job("Reading the plan", |_, _| {
            Ok(move |_: &Reporter<'_>| {
                let (plan, notes) = exchange::read(&path, &scene.header, scene_file.as_deref())?;
                Ok(JobMessage::Plan(plan, notes))
            })
        });
    }

    /// Starts to write the plan to a file, or `by_hand` if there is no plan of many needles.
    pub fn export(&mut self, path: PathBuf, scene_file: Option<PathBuf>, by_hand: Option<ImplantPlan>) {
        self.begin_job("Writing the plan", |planner, outlines| {
            let plan = by_hand.map_or_else(|| planner.planned().cloned(), Ok)?;
            Ok(move |_: &Reporter<'_>| {
                exchange::write(&path, &plan, &outlines.frames, scene_file.as_deref())?;
                Ok(JobMessage::End(format!("Plan saved as {}", path.display())))
            })
        });
    }

    /// Starts to write structure set, plan and dose. Patient and frame come from `like` if it is a
    /// DICOM file.
    pub fn export_study(&mut self, folder: PathBuf, scene: Arc<SceneModel>, like: Option<PathBuf>) {
        self.begin_job("Writing the DICOM study", |planner, outlines| {
            let plan = planner.planned()?.clone();
            Ok(move |reporter: &Reporter<'_>| {
                let report = |share| reporter.report(share);
                let notes = study::write(&folder, &plan, (&scene, &outlines.anatomy), like.as_deref(), &report)?;
                let notes = match notes.is_empty() {
                    true => String::new(),
                    false => format!(": {}", notes.join("; ")),
                };
                Ok(JobMessage::End(format!("Study saved as {}{notes}", folder.display())))
            })
        });
    }

    /// Compensates the needles that are not inserted yet, one after the other, through a separate link: the window
    /// keeps its own.
    pub fn compensate(&mut self, instance: Instance, pace: Pace) {
        self.begin_job("Rehearsing", |planner, _| {
            let begun = planner.planning.progress.begun();
            let left = planner.planned()?.needles.iter().enumerate().skip(begun);
            let loaded = left.filter(|(_, needle)| !needle.seeds.is_empty());
            let needles: Vec<(usize, Needle)> = loaded.map(|(number, needle)| (number, needle.clone())).collect();
            if needles.is_empty() {
                return Err("No needle with seeds is left to rehearse.".into());
            }
            Ok(move |reporter: &Reporter<'_>| compensate_all(instance, &needles, &pace, reporter))
        });
    }
}

fn compensate_all(
    instance: Instance,
    needles: &[(usize, Needle)],
    pace: &Pace,
    reporter: &Reporter<'_>,
) -> Result<JobMessage, Failure> {
    if crate::IN_PAGE {
        return Err("A web page has no thread to rehearse needles on; compensate them in the program.".into());
    }
    let mut link = Link::new(instance);
    let begun = Instant::now();
    while link.scene().is_none() || link.state().is_none() {
        if reporter.interrupt.asked() || begun.elapsed() > FIND_LIMIT {
            return Err("rt-core does not answer; check that it is running.".into());
        }
        link.poll();
        std::thread::sleep(POLL_EVERY);
    }
    let (mut failed, begun) = (Vec::new(), Instant::now());
    for (at, (number, needle)) in needles.iter().enumerate() {
        let name = name_of(*number, needle);
        let (what, share) = rehearsing(needles, at, begun.elapsed());
        reporter.is_at(what, share);
        let mut rehearser = LinkRehearser {
            stabilising: &[],
            earlier: &[],
            link: &mut link,
            interrupted: reporter.interrupt,
        };
        match compensate(needle, pace, &Limits::default(), &mut rehearser) {
            Ok(done) => reporter.send(JobMessage::Compensated(Box::new((needle.clone(), done)))),
            Err(_) if reporter.interrupt.asked() => return Err("The compensation was cancelled.".into()),
            Err(why) => failed.push(format!("{name}: {why}")),
        }
    }
    match failed.as_slice() {
        [] => Ok(JobMessage::End(format!("{} needles compensated.", needles.len()))),
        _ => Err(format!("Not compensated: {}", failed.join("; ")).into()),
    }
}

/// Returns a name such as "needle 3 (F7)", by the number in the plan.
fn name_of(number: usize, needle: &Needle) -> String {
    let hole = needle.hole.map_or_else(String::new, |hole| format!(" ({hole})"));
    format!("needle {}{hole}", number + 1)
}

/// Returns the progress before one of the needles, in words and as a share of their seeds, with the time left once a
/// needle is done: a needle takes about as long as it has seeds.
fn rehearsing(needles: &[(usize, Needle)], at: usize, elapsed: Duration) -> (String, f32) {
    let seeds = |of: &[(usize, Needle)]| of.iter().map(|(_, needle)| needle.seeds.len()).sum::<usize>() as f64;
    let (number, needle) = &needles[at];
    let share = seeds(&needles[..at]) / seeds(needles);
    let left = match at {
        0 => String::new(),
        _ => {
            let left_s = elapsed.as_secs_f64() * (1.0 - share) / share;
            format!("; {}", format::time_left(left_s))
        }
    };
    let name = name_of(*number, needle);
    (
        format!("Rehearsing {name}, {} of {}{left}", at + 1, needles.len()),
        share as f32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::tests::planned;

    /// Guards against minutes of compensation without the time left, and needles counted unlike those of the plan.
    #[test]
    fn a_rehearsal_names_its_needle_and_the_time_left() {
        let needles: Vec<(usize, Needle)> = planned()
            .needles
            .into_iter()
            .enumerate()
            .map(|(n, of)| (n + 5, of))
            .collect();
        let at = |at, s| rehearsing(&needles, at, Duration::from_secs(s));
        assert_eq!(at(0, 0), ("Rehearsing needle 6 (E7), 1 of 2".to_owned(), 0.0));
        let second = "Rehearsing needle 7 (I7), 2 of 2; about 4 min left".to_owned();
        assert_eq!(at(1, 240), (second, 0.5));
    }
}
