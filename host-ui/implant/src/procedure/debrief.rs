//! After the last needle: what the implant was worth, written beside the other results.

use super::Seen;
use super::error::ProcedureError;
use super::job::{self, Job, PlannedDrop};
use crate::plan::Anatomy;
use crate::score::{self, Implant, Motion, Score, SeedPair};
use std::path::Path;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Seed, Source};
use stylet_host::link::{Link, SceneModel};
use stylet_shm_schema::SeedPose;

/// Writes `score.json` and `debrief.html`; nothing without a plan file, whose seeds have no strength. `source` by the plan's name
/// where no file is given.
pub fn write(
    out: &Path,
    link: &Link,
    scene: &SceneModel,
    job: &Job,
    seen: &Seen,
    source: Option<&Path>,
) -> Result<(), ProcedureError> {
    let Some(implant) = &job.implant else { return Ok(()) };
    let source = match source {
        Some(path) => Source::read(path).map_err(|e| ProcedureError::Input(e.to_string()))?,
        None => Source::known(&implant.source).ok_or_else(|| {
            let model = &implant.source;
            ProcedureError::Input(format!("no source is known as \"{model}\"; give --source FILE"))
        })?,
    };
    let header = &link
        .snapshot()
        .ok_or(ProcedureError::NothingReceived("the core sent no tissue"))?
        .header;
    let placed = &header.seeds[..header.seed_count as usize];
    let drops = job.planned();
    let planned = |drop: &PlannedDrop| {
        Some(Seed {
            position_m: drop.planned_m,
            axis: Some(drop.direction),
            strength_u: drop.strength_u?,
        })
    };
    let pair = |(drop, pose): (&PlannedDrop, &SeedPose)| {
        let planned = planned(drop)?;
        Some(SeedPair {
            needle: drop.needle,
            hole: drop.hole,
            planned,
            delivered: Seed {
                position_m: pose.position_m,
                axis: Some(pose.axis),
                ..planned
            },
            direction: drop.direction,
        })
    };
    let anatomy = Anatomy::of(scene)?;
    let kernel = DoseKernel::new(&source, Interval::ALL);
    let score = Score::of(Implant {
        title: format!("Scene {}", scene.header.name.read()),
        pairs: job::placed(&drops, &seen.lost, placed).filter_map(pair).collect(),
        lost: seen
            .lost
            .iter()
            .filter_map(|&n| drops.get(n))
            .filter_map(planned)
            .collect(),
        anatomy: &anatomy,
        kernel: &kernel,
        source: format!("{} {}", source.nuclide, source.model),
        prescription_gy: implant.prescription_gy,
        motion: Motion::of(&seen.records, drops.first().map_or([0.0, 0.0, 1.0], |d| d.direction)),
        records: &seen.records,
    })?;
    score::write(&score, out)?;
    print!("planned\n{}", score.judge.table(&score.planned));
    print!("delivered\n{}", score.judge.table(&score.delivered));
    println!("debrief: {}", out.join("debrief.html").display());
    Ok(())
}
