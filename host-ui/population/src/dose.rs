//! Dose of each implant, as planned and with its seeds at rest, in the target of its scene.

use crate::error::PopulationError;
use std::collections::BTreeMap;
use std::path::Path;
use stylet_dose::decay::Interval;
use stylet_dose::report::choose_target;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Seed as DoseSeed, Source};
use stylet_files::{Progress, read_voxels};
use stylet_implant::readers::labels;
use stylet_insertions::{Insertion, Table, structures_file};

/// Points in a target.
const POINTS: usize = 20_000;

/// Dose of a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covered {
    /// Least dose of the hottest 90 % of the target, in percent of the prescription.
    pub d90_percent: f64,
    /// Share of the target at the prescription or more.
    pub v100_percent: f64,
}

/// One implant.
#[derive(Clone, Debug, PartialEq)]
pub struct ImplantDose {
    /// Scene, plan and number.
    pub id: String,
    /// Number of seeds.
    pub seeds: usize,
    /// Dose of the seeds at their planned places.
    pub planned: Covered,
    /// Dose of the seeds at rest.
    pub delivered: Covered,
}

/// Implants whose needles were all inserted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scored {
    /// Implants in the order of the study.
    pub implants: Vec<ImplantDose>,
    /// Implants with a failed needle or in an unfinished shard: they have no dose.
    pub incomplete: usize,
    /// Reason why no dose was computed.
    pub missing: Option<String>,
}

struct Target {
    points: DosePoints,
    volumes_m3: Vec<f64>,
}

/// Scores every implant; `folder` has the structures of the scenes. Calls `done` after each.
///
/// # Errors
///
/// If structures cannot be read, or a source is unknown.
pub fn score(folder: &Path, table: &Table, done: impl Fn()) -> Result<Scored, PopulationError> {
    let mut implants: BTreeMap<&str, Vec<&Insertion>> = BTreeMap::new();
    for row in &table.rows {
        implants.entry(implant_id(row)).or_default().push(row);
    }
    let mut needles: BTreeMap<[&str; 2], usize> = BTreeMap::new();
    for row in &table.rows {
        let most = needles.entry([&row.scene, &row.plan]).or_default();
        *most = (*most).max(row.needle as usize);
    }
    let (mut targets, mut kernels, mut planned) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    let mut scored = Scored::default();
    for (id, rows) in implants {
        let first = rows[0];
        done();
        let whole = rows.len() == needles[&[first.scene.as_str(), first.plan.as_str()]];
        if !whole || rows.iter().any(|row| row.outcome.is_err()) {
            scored.incomplete += 1;
            continue;
        }
        if !targets.contains_key(&first.scene) {
            targets.insert(first.scene.clone(), target(folder, &first.scene)?);
        }
        if !kernels.contains_key(&first.source) {
            kernels.insert(first.source.clone(), kernel(&first.source)?);
        }
        let (target, kernel) = (&targets[&first.scene], &kernels[&first.source]);
        let covered = |seeds: &[DoseSeed]| covered(target, kernel, seeds, first.prescription_gy);
        let as_planned = *planned
            .entry([first.scene.clone(), first.plan.clone()])
            .or_insert_with(|| covered(&seeds(&rows, false)));
        scored.implants.push(ImplantDose {
            id: id.to_owned(),
            seeds: rows.iter().map(|row| row.seeds.len()).sum(),
            planned: as_planned,
            delivered: covered(&seeds(&rows, true)),
        });
    }
    Ok(scored)
}

/// Returns the id without the needle.
fn implant_id(row: &Insertion) -> &str {
    row.id.rsplit_once('/').map_or(&row.id, |(implant, _)| implant)
}

fn target(folder: &Path, scene: &str) -> Result<Target, PopulationError> {
    let voxels = read_voxels(&structures_file(folder, scene), &Progress::default())?;
    let mut structures = labels::structures(&voxels, &voxels.names, POINTS);
    let names: Vec<&str> = structures.iter().map(|s| s.name.as_str()).collect();
    let target = structures.swap_remove(choose_target(&names, None)?);
    Ok(Target {
        points: DosePoints::new(&target.points_m),
        volumes_m3: target.volumes_m3,
    })
}

fn kernel(model: &str) -> Result<DoseKernel, PopulationError> {
    let source = Source::known(model).ok_or_else(|| PopulationError::Source {
        model: model.to_owned(),
        known: Source::all_known().map(|s| s.model).collect::<Vec<_>>().join(", "),
    })?;
    Ok(DoseKernel::new(&source, Interval::ALL))
}

/// Returns the seeds at their planned places, or at rest.
fn seeds(rows: &[&Insertion], at_rest: bool) -> Vec<DoseSeed> {
    let all = rows.iter().flat_map(|row| &row.seeds);
    let seed = |seed: &stylet_insertions::Seed| {
        let rest = seed.rest.filter(|_| at_rest);
        DoseSeed {
            position_m: rest.map_or(seed.planned_mm, |r| r.at_mm).map(|mm| mm * 1e-3),
            axis: Some(rest.map_or(seed.planned_axis, |r| r.axis)),
            strength_u: seed.strength_u,
        }
    };
    all.map(seed).collect()
}

fn covered(target: &Target, kernel: &DoseKernel, seeds: &[DoseSeed], prescription_gy: f64) -> Covered {
    let Some(dvh) = Dvh::new(&target.points.of_seeds_gy(kernel, seeds), &target.volumes_m3) else {
        return Covered {
            d90_percent: 0.0,
            v100_percent: 0.0,
        };
    };
    Covered {
        d90_percent: 100.0 * dvh.dose_of_gy(0.9 * dvh.volume_m3()).unwrap_or(0.0) / prescription_gy,
        v100_percent: 100.0 * dvh.at_least_m3(prescription_gy) / dvh.volume_m3(),
    }
}
