//! The debrief as files: the page of `host-ui procedure`, from the data of the window.

use super::App;
use crate::planner;
use crate::shown::{Note, SeedError, all_errors};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stylet_base::format;
use stylet_base::job::{Job, JobUpdate};
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Seed, Source};
use stylet_host::link::{Link, SceneModel};
use stylet_host::moments::Moment;
use stylet_implant::intraoperative::Reviewed;
use stylet_implant::plan::{Anatomy, Hole, ImplantPlan, Template, exchange, file};
use stylet_implant::provenance;
use stylet_implant::received::ReceivedProcedure;
use stylet_implant::score::{self, Implant, Motion, Score, SeedPair, seed_of};
use stylet_shm_schema::{Prescribed, Text, TickRecord};

/// Name of what was written, or the reason why it could not be.
pub(super) type Saved = Result<String, Failure>;
/// Any error, shown as text.
pub(super) type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Returns the whole path of a new folder under out/, named after what is written and the time.
pub(super) fn folder_of(why: &str) -> PathBuf {
    let folder = PathBuf::from(format!("out/{why}-{}", format::utc_now()));
    std::path::absolute(&folder).unwrap_or(folder)
}

/// Data of a debrief, as of the request for it.
pub(super) struct Delivered {
    scene: Arc<SceneModel>,
    title: String,
    source: Source,
    prescription_gy: f64,
    pairs: Vec<SeedPair>,
    lost: Vec<Seed>,
    unplanned: Vec<Seed>,
    motion: Motion,
    records: Vec<TickRecord>,
    moments: Vec<Moment>,
    updates: Vec<Reviewed>,
    /// Plan as its file would be; `None` for one needle by hand, and for a plan received from
    /// another window.
    plan: Option<ImplantPlan>,
}

impl App {
    /// Starts writing the files; [`App::take_debrief`] reports when they are written.
    pub(super) fn save_debrief(&mut self) {
        if let Some(number) = self.trainees.followed {
            return self.debrief_trainee(number);
        }
        let folder = self.trainees.folder().unwrap_or_else(|| folder_of("debrief"));
        self.save_debrief_as(folder);
    }

    /// Keeps the result when the core ends for any reason: the placed seeds stay shown and are
    /// written with the plan.
    pub(super) fn keep_of_ended_core(&mut self) {
        let is_absent = self.shown.is_absent();
        let was_absent = std::mem::replace(&mut self.was_absent, is_absent);
        let has_ended = is_absent && !was_absent;
        let is_own = self.trainees.followed.is_none() && !self.watches();
        if has_ended && is_own {
            self.save_implant("core-ended");
        }
    }

    /// Writes plan and debrief, as far as there are any, to a new folder under out/.
    pub(super) fn save_implant(&mut self, why: &str) {
        let folder = folder_of(why);
        self.save_plan(&folder);
        self.save_seeds(folder);
    }

    pub(super) fn save_plan(&mut self, folder: &Path) {
        let by_hand = self.plan_by_hand();
        let has_plan = by_hand.is_some() || self.shown.planning.implant.is_some();
        if has_plan && std::fs::create_dir_all(folder).is_ok() {
            let file = folder.join("plan.toml");
            self.planner.export(file, self.scene_file(), by_hand);
        }
    }

    /// Returns the plan of one needle by hand.
    fn plan_by_hand(&self) -> Option<ImplantPlan> {
        let plan = self.shown.plan.filter(|_| self.shown.is_one_needle_by_hand())?;
        let known = self.planned_as();
        let (source, dose_gy) = source_of(&known.source.read(), known.dose_gy).ok()?;
        let mut needle = plan.needle();
        needle.prescribed = Prescribed {
            dose_gy,
            source: Text::new(&source.model),
            ..known
        };
        let template = Template::before(self.shown.scene.as_ref()?);
        Some(ImplantPlan::of_one_needle(&needle, template))
    }

    pub(super) fn save_seeds(&mut self, folder: PathBuf) {
        if !self.shown.seeds.is_empty() {
            self.save_debrief_as(folder);
        }
    }

    pub(super) fn save_debrief_as(&mut self, folder: PathBuf) {
        let delivered = self.delivered();
        self.write_debrief(delivered, folder);
    }

    /// Writes one debrief at a time.
    pub(super) fn write_debrief(&mut self, delivered: Result<Delivered, Failure>, folder: PathBuf) {
        if self.debrief.is_some() {
            self.refuse("A debrief is being written: try again in a moment.");
            return;
        }
        match delivered {
            Ok(delivered) => {
                self.debrief = Some(Job::begin("debrief", move |messages, _| {
                    // The window may have closed; the answer is then dropped.
                    let _ = messages.send(write(&delivered, folder));
                }));
            }
            Err(why) => self.refuse(why),
        }
    }

    pub(super) fn take_debrief(&mut self) {
        let Some(job) = &self.debrief else { return };
        let saved = match job.poll() {
            JobUpdate::Pending => return,
            JobUpdate::Message(saved) => saved,
            JobUpdate::Ended => Err("The debrief was not written: its thread ended before it replied.".into()),
        };
        self.debrief = None;
        self.shown.note = Some(match saved {
            Ok(name) => Note::done(format!("Debrief saved as {name}")),
            Err(why) => Note::refusal(why),
        });
    }

    fn delivered(&self) -> Result<Delivered, Failure> {
        let mut delivered = Delivered::of_heard(&self.link, &self.heard, self.planned_as(), None)?;
        let Some(implant) = &self.shown.planning.implant else {
            return Ok(delivered);
        };
        (delivered.source, delivered.prescription_gy) = source_of(&implant.plan.source, implant.plan.prescription_gy)?;
        delivered.title = format!("Scene {}", delivered.scene.header.name.read());
        (delivered.pairs, delivered.lost, delivered.unplanned) = self.pairs(implant);
        (delivered.updates, delivered.plan) = (self.planner.reviewed().to_vec(), Some(implant.plan.clone()));
        Ok(delivered)
    }

    /// Returns the seeds in the tissue, each with its planned one; those planned without one, also of the needles to
    /// come; those without a plan.
    fn pairs(&self, implant: &planner::Implant) -> (Vec<SeedPair>, Vec<Seed>, Vec<Seed>) {
        let (mut pairs, mut lost) = (Vec::new(), Vec::new());
        let seeds = &self.shown.seeds;
        let mut has_plan = vec![false; seeds.len()];
        for (needle, row) in all_errors(&self.shown) {
            let Some((hole, planned, placed)) = self.pair(implant, needle, &row) else {
                continue;
            };
            match placed {
                Some(n) => {
                    has_plan[n] = true;
                    pairs.push(SeedPair::new((needle, hole), planned, &seeds[n]));
                }
                None => lost.push(planned),
            }
        }
        let to_come = implant.plan.needles.iter().skip(self.shown.planning.progress.begun());
        lost.extend(to_come.flat_map(|needle| needle.dose_seeds()));
        let (strength_u, others) = (self.planned_as().strength_u, seeds.iter().zip(has_plan));
        let others = others.filter(|(_, has_plan)| !has_plan);
        let unplanned = others.map(|(pose, _)| seed_of(pose, strength_u)).collect();
        (pairs, lost, unplanned)
    }

    /// Returns the hole of a planned seed, the seed, and the number of the one that was dropped for
    /// it.
    fn pair(
        &self,
        implant: &planner::Implant,
        needle: usize,
        row: &SeedError,
    ) -> Option<(Option<Hole>, Seed, Option<usize>)> {
        let shown = &self.shown;
        let of = implant.plan.needles.get(needle)?;
        let planned = of.dose_seeds().nth(row.planned)?;
        let own = shown.planning.progress.seeds_of(needle, shown.seeds.len());
        let placed = row.placed.map(|n| own.start + n).filter(|n| own.contains(n));
        Some((of.hole, planned, placed))
    }
}

/// Returns source and prescription; a plan without them gets the usual ones.
fn source_of(model: &str, prescription_gy: f64) -> Result<(Source, f64), Failure> {
    if model.is_empty() {
        return Ok(exchange::usual()?);
    }
    Ok((Source::named(model)?, prescription_gy))
}

impl Delivered {
    /// Builds the debrief of a procedure that another window planned and drove. `planned` gives the
    /// seeds if its plan does not.
    pub(super) fn of_heard(
        link: &Link,
        heard: &ReceivedProcedure,
        planned: Prescribed,
        trainee: Option<&str>,
    ) -> Result<Self, Failure> {
        let scene = link.scene().ok_or("There is no scene yet.")?.clone();
        let (source, prescription_gy) = source_of(&planned.source.read(), planned.dose_gy)?;
        let (pairs, lost, unplanned) = heard.pairs(planned.strength_u);
        let mut title = format!("Scene {}", scene.header.name.read());
        if let Some(name) = trainee {
            title = format!("{title}, {name}");
        }
        let of = heard.prescribed().filter(|of| of.needle < of.last_needle);
        if let Some(of) = of {
            title = format!("{title}, up to needle {} of {}", of.needle, of.last_needle);
        }
        if heard.seeds_before() > 0 {
            title = format!("{title}, without the first {} seeds", heard.seeds_before());
        }
        Ok(Self {
            title,
            scene,
            source,
            prescription_gy,
            pairs,
            lost,
            unplanned,
            motion: heard.trace().motion(),
            records: heard.trace().records().to_vec(),
            moments: heard.own_moments(),
            updates: Vec::new(),
            plan: None,
        })
    }

    /// Returns the provenance: scene by its labels, plan by the text of its file, source by its
    /// model.
    fn made(&self) -> Result<serde_json::Value, Failure> {
        let plan = match &self.plan {
            Some(plan) => file::to_text(plan, &self.scene.header.patient())?,
            None => String::new(),
        };
        let named = [
            ("labels of the scene", &self.scene.labels[..]),
            ("plan", plan.as_bytes()),
            ("model of the source", self.source.model.as_bytes()),
        ];
        let inputs: Vec<(&str, &[u8])> = named.into_iter().filter(|(_, content)| !content.is_empty()).collect();
        Ok(provenance::made_of(&inputs))
    }
}

fn write(delivered: &Delivered, folder: PathBuf) -> Saved {
    let anatomy = Anatomy::of(&delivered.scene)?;
    let kernel = DoseKernel::new(&delivered.source, Interval::ALL);
    let score = Score::of(Implant {
        title: delivered.title.clone(),
        pairs: delivered.pairs.clone(),
        lost: delivered.lost.clone(),
        unplanned: delivered.unplanned.clone(),
        anatomy: &anatomy,
        kernel: &kernel,
        source: format!("{} {}", delivered.source.nuclide, delivered.source.model),
        prescription_gy: delivered.prescription_gy,
        motion: delivered.motion,
        records: &delivered.records,
        moments: delivered.moments.clone(),
        updates: delivered.updates.clone(),
    })?;
    save(&score, delivered.made()?, &folder)
}

#[cfg(not(target_family = "wasm"))]
fn save(score: &Score, made: serde_json::Value, folder: &Path) -> Saved {
    std::fs::create_dir_all(folder).map_err(|e| format!("{} cannot be created ({e})", folder.display()))?;
    score::write(score, made, folder)?;
    Ok(folder.display().to_string())
}

/// A page has no folders: its reader gets the files.
#[cfg(target_family = "wasm")]
fn save(score: &Score, made: serde_json::Value, _: &Path) -> Saved {
    let files = score::files(score, made)?;
    for (name, text) in &files {
        crate::download::offer(name, text.as_bytes()).map_err(|why| format!("no download of {name}: {why:?}"))?;
    }
    Ok(files.map(|(name, _)| name).join(" and "))
}

#[cfg(test)]
mod tests {
    use crate::app::tests::fixture::{Drawn, many_needles, one_needle};

    /// Guards against a "planned" D90 of the needles that were begun, beside limits of the whole implant.
    #[test]
    fn the_planned_dose_is_that_of_the_whole_plan() {
        let mut drawn = Drawn::new([1280.0, 720.0], 1.0);
        drawn.app.shown = many_needles(5, 1);
        drawn.app.shown.seeds = one_needle(0.0, 3).seeds;
        let implant = drawn.app.shown.planning.implant.clone().expect("a plan");
        let (pairs, lost, unplanned) = drawn.app.pairs(&implant);
        assert_eq!(pairs.len() + lost.len(), implant.plan.seed_count());
        assert_eq!((pairs.len(), unplanned.len()), (2, 1));
    }
}
