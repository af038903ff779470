//! The score after the last needle, written next to the other results.

use super::Observations;
use super::error::ProcedureError;
use super::job::{self, Job, PlannedDrop};
use crate::plan::{Anatomy, ImplantPlan};
use crate::readers::read_source;
use crate::score::{self, Implant, Motion, Score, SeedPair};
use serde_json::Value;
use std::path::Path;
use stylet_base::nuclide::Nuclide;
use stylet_dose::decay::Interval;
use stylet_dose::{DoseKernel, Seed, Source};
use stylet_host::link::{Link, SceneModel};
use stylet_host::moments::Moment;
use stylet_shm_schema::SeedPose;

/// Writes `score.json` and `debrief.html`; nothing without a plan file, whose seeds have no
/// strength. `source` defaults to the plan's source.
pub fn write(
    out: &Path,
    link: &Link,
    scene: &SceneModel,
    job: &Job,
    seen: &Observations,
    source: Option<&Path>,
    made: Value,
) -> Result<(), ProcedureError> {
    let Some(implant) = &job.implant else { return Ok(()) };
    let source = source_of(implant, source)?;
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
    let pair =
        |(drop, pose): (&PlannedDrop, &SeedPose)| Some(SeedPair::new((drop.needle, drop.hole), planned(drop)?, pose));
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
        // A script drops planned seeds only.
        unplanned: Vec::new(),
        anatomy: &anatomy,
        kernel: &kernel,
        source: format!("{} {}", source.nuclide, source.model),
        prescription_gy: implant.prescription_gy,
        motion: Motion::of(&seen.records, drops.first().map_or([0.0, 0.0, 1.0], |d| d.direction)),
        records: &seen.records,
        moments: seen.events.iter().filter_map(Moment::of).collect(),
        updates: Vec::new(),
    })?;
    score::write(&score, made, out)?;
    print!(
        "planned\n{}",
        stylet_base::format::printable_table(&score.judge.table(&score.planned))
    );
    print!(
        "delivered\n{}",
        stylet_base::format::printable_table(&score.judge.table(&score.delivered))
    );
    println!("debrief: {}", out.join("debrief.html").display());
    Ok(())
}

/// Returns the source for the score: the requested one, or the plan's. Refuses one of another
/// isotope than the plan's.
pub fn source_of(implant: &ImplantPlan, asked: Option<&Path>) -> Result<Source, ProcedureError> {
    let of_plan = Source::named(&implant.source);
    let Some(path) = asked else {
        return of_plan.map_err(ProcedureError::UnknownSource);
    };
    let source = read_source(path)?;
    let is_other = |planned: &Source| Nuclide::parse(&planned.nuclide) != Nuclide::parse(&source.nuclide);
    match of_plan.ok().filter(is_other) {
        Some(planned) => Err(ProcedureError::OtherIsotope {
            path: path.to_owned(),
            isotope: source.nuclide,
            planned: planned.nuclide,
            model: planned.model,
        }),
        None => Ok(source),
    }
}
