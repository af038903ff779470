//! The debrief as files: the same page as `host-ui procedure` writes, from the data of the window.

use super::{App, refusal};
use crate::shown::{Note, SeedError, all_errors};
use std::path::PathBuf;
use std::sync::Arc;
use stylet_base::format;
use stylet_base::job::{Job, JobUpdate};
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Seed, Source};
use stylet_host::link::SceneModel;
use stylet_host::moments::Moment;
use stylet_implant::intraoperative::Reviewed;
use stylet_implant::plan::{Anatomy, ImplantPlan, exchange, file};
use stylet_implant::provenance;
use stylet_implant::score::{self, Implant, Motion, Score, SeedPair};
use stylet_shm_schema::{SeedPose, TickRecord};

/// The folder of what was written, or why it could not be.
pub(super) type Saved = Result<PathBuf, Failure>;
/// Whatever was wrong, to be shown as text.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Everything that a debrief is made of, as it was when it was asked for.
struct Delivered {
    scene: Arc<SceneModel>,
    source: Source,
    prescription_gy: f64,
    pairs: Vec<SeedPair>,
    lost: Vec<Seed>,
    motion: Motion,
    records: Vec<TickRecord>,
    moments: Vec<Moment>,
    updates: Vec<Reviewed>,
    /// The plan as its file would be; `None` for one needle by hand.
    plan: Option<ImplantPlan>,
}

impl App {
    /// Begins to write the files; [`App::take_debrief`] reports when they are written.
    pub(super) fn save_debrief(&mut self) {
        let own = || PathBuf::from(format!("out/debrief-{}", format::utc_now()));
        let folder = self.trainees.folder().unwrap_or_else(own);
        self.save_debrief_as(folder);
    }

    pub(super) fn save_debrief_as(&mut self, folder: PathBuf) {
        if self.debrief.is_some() {
            return;
        }
        match self.delivered() {
            Ok(delivered) => {
                self.debrief = Some(Job::begin("debrief", move |messages, _| {
                    // The window may be closed by now; then nobody reads the answer.
                    let _ = messages.send(write(&delivered, folder));
                }));
            }
            Err(why) => self.shown.note = Some(refusal(why.to_string())),
        }
    }

    pub(super) fn take_debrief(&mut self) {
        let Some(job) = &self.debrief else { return };
        let saved = match job.poll() {
            JobUpdate::Pending => return,
            JobUpdate::Message(saved) => saved,
            JobUpdate::Ended => Err("the debrief was not written: its thread ended before it replied".into()),
        };
        self.debrief = None;
        self.shown.note = Some(match saved {
            Ok(folder) => Note {
                refused: false,
                text: format!("Debrief saved as {}", folder.display()),
            },
            Err(why) => refusal(why.to_string()),
        });
    }

    fn delivered(&self) -> Result<Delivered, Failure> {
        let scene = self.link.scene().ok_or("there is no scene yet")?.clone();
        let implant = self.shown.planning.implant.as_ref();
        let (source, prescription_gy) = match implant {
            None => exchange::usual()?,
            Some(implant) => {
                let model = &implant.plan.source;
                let source = Source::known(model).ok_or_else(|| format!("no source is known as \"{model}\""))?;
                (source, implant.plan.prescription_gy)
            }
        };
        let (mut pairs, mut lost) = (Vec::new(), Vec::new());
        for (needle, row) in all_errors(&self.shown) {
            let Some((pair, placed)) = self.pair(needle, &row) else {
                continue;
            };
            match placed {
                Some(pose) => pairs.push(SeedPair {
                    delivered: Seed {
                        position_m: pose.position_m,
                        axis: Some(pose.axis),
                        ..pair.planned
                    },
                    ..pair
                }),
                None => lost.push(pair.planned),
            }
        }
        Ok(Delivered {
            scene,
            source,
            prescription_gy,
            pairs,
            lost,
            motion: self.trace.motion(),
            records: self.trace.records().to_vec(),
            moments: self.moments.since(self.trace.began_ns().unwrap_or(u64::MAX)),
            updates: self.planner.reviewed().to_vec(),
            plan: implant.map(|implant| implant.plan.clone()),
        })
    }

    /// A planned seed, as if it lay on plan, and the one that was dropped for it.
    fn pair(&self, needle: usize, row: &SeedError) -> Option<(SeedPair, Option<SeedPose>)> {
        let shown = &self.shown;
        let of_needle = |hole, position_m, direction: [f64; 3], strength_u| {
            let planned = Seed {
                position_m,
                axis: Some(direction),
                strength_u,
            };
            SeedPair {
                needle,
                hole,
                planned,
                delivered: planned,
                direction,
            }
        };
        let Some(implant) = &shown.planning.implant else {
            let planned = shown.planned().get(row.planned)?;
            let direction = shown.plan.as_ref()?.direction;
            let pair = of_needle(None, planned.position_m, direction, self.settings.seed_strength_u);
            return Some((pair, row.placed.and_then(|n| shown.seeds.get(n)).copied()));
        };
        let of = implant.plan.needles.get(needle)?;
        let seed = of.seeds.get(row.planned)?;
        let pair = of_needle(of.hole, of.at_m(seed.along_m), of.direction, seed.strength_u);
        let own = shown.planning.progress.seeds_of(needle, shown.seeds.len());
        Some((pair, row.placed.and_then(|n| shown.seeds[own].get(n)).copied()))
    }
}

impl Delivered {
    /// The scene by its labels, the plan by the text of its file, and the source by its model.
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

fn write(delivered: &Delivered, folder: PathBuf) -> Result<PathBuf, Failure> {
    let anatomy = Anatomy::of(&delivered.scene)?;
    let kernel = DoseKernel::new(&delivered.source, Interval::ALL);
    let score = Score::of(Implant {
        title: format!("Scene {}", delivered.scene.header.name.read()),
        pairs: delivered.pairs.clone(),
        lost: delivered.lost.clone(),
        anatomy: &anatomy,
        kernel: &kernel,
        source: format!("{} {}", delivered.source.nuclide, delivered.source.model),
        prescription_gy: delivered.prescription_gy,
        motion: delivered.motion,
        records: &delivered.records,
        moments: delivered.moments.clone(),
        updates: delivered.updates.clone(),
    })?;
    std::fs::create_dir_all(&folder).map_err(|e| format!("{} cannot be created ({e})", folder.display()))?;
    score::write(&score, delivered.made()?, &folder)?;
    Ok(folder)
}
