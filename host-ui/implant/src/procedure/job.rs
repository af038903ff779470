//! The task of a procedure: needles with plans and drops, from a plan file or as the scene
//! suggests.

use super::error::ProcedureError;
use crate::pairing;
use crate::plan::compensate::summary_m;
use crate::plan::exchange;
use crate::plan::rehearse::{Drops, LinkRehearser};
use crate::plan::seeds;
use crate::plan::stabilise::{Stabilising, stabilising};
use crate::plan::{Anatomy, Compensation, Hole, ImplantPlan, Limits, Needle, Template, check, compensate};
use crate::workflow::{NeedleTask, Pace, plan_with_seeds};
use std::collections::BTreeMap;
use std::path::Path;
use stylet_base::interrupt::Interrupt;
use stylet_host::link::{Link, SceneModel};
use stylet_shm_schema::{MAX_SEEDS, PlannedNeedle, SeedPose};

/// Planned seed, in the order of the drops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedDrop {
    /// Index of the needle, from 0.
    pub needle: usize,
    /// Hole of the needle; `None` for one that is held by hand.
    pub hole: Option<Hole>,
    /// Planned place, scene frame, m.
    pub planned_m: [f64; 3],
    /// Direction of the needle, into the body.
    pub direction: [f64; 3],
    /// Strength; `None` without a plan file.
    pub strength_u: Option<f64>,
    /// Place of the seed at rest in the rehearsal of this drop, scene frame, m; `None` without a
    /// rehearsal.
    pub rehearsed_m: Option<[f64; 3]>,
}

/// Returns each seed in the tissue with its planned one; `lost` are the numbers of drops that left
/// none.
pub fn placed<'a>(
    planned: &'a [PlannedDrop],
    lost: &'a [usize],
    seeds: &'a [SeedPose],
) -> impl Iterator<Item = (&'a PlannedDrop, &'a SeedPose)> {
    let pairs = pairing::in_order(planned.len(), lost, seeds.len());
    let pair = |(drop, place): (&'a PlannedDrop, Option<usize>)| Some((drop, &seeds[place?]));
    planned.iter().zip(pairs).filter_map(pair)
}

/// Task of one procedure.
pub struct Job {
    /// Plan; `None` without a plan file: one needle as the scene suggests.
    pub implant: Option<ImplantPlan>,
    /// Needles with seeds, in their order.
    pub needles: Vec<Needle>,
    /// Their plans and drops.
    pub tasks: Vec<NeedleTask>,
    /// Compensations by the number of the needle, if requested and possible.
    pub compensations: BTreeMap<usize, Compensation>,
    /// Needles that go in first and stay until the others have left their seeds.
    pub stabilising: Vec<Stabilising>,
}

impl Job {
    /// Creates a task of one needle through the middle of the target.
    pub fn suggested(scene: &SceneModel, seeds: usize) -> Self {
        let plan = plan_with_seeds(&scene.header, seeds);
        Self {
            implant: None,
            needles: vec![needle_of(&plan)],
            tasks: vec![NeedleTask::as_planned(plan)],
            compensations: BTreeMap::new(),
            stabilising: Vec::new(),
        }
    }

    /// Reads a plan file, a table of seeds or an RT Plan, in the patient's frame, of the patient of the
    /// scene's file. Doubtful content
    /// is reported and not refused.
    pub fn from_file(path: &Path, scene: &SceneModel, scene_file: Option<&Path>) -> Result<Self, ProcedureError> {
        let (plan, notes) = exchange::read(path, &scene.header, scene_file)?;
        seeds::report(path, &notes);
        if plan.seed_count() == 0 || plan.seed_count() > MAX_SEEDS {
            return Err(ProcedureError::SeedCount {
                path: path.to_owned(),
                seeds: plan.seed_count(),
            });
        }
        for problem in check::problems(&plan, &Anatomy::of(scene)?) {
            println!(
                "note: {}: {}",
                path.display(),
                stylet_base::format::printable_line(&problem.to_string())
            );
        }
        let task = |(number, needle): (usize, &Needle)| {
            let drops = (!needle.seeds.is_empty()).then(|| Drops::as_planned(needle))?;
            NeedleTask::of(&plan, number, drops)
        };
        Ok(Self {
            needles: plan.needles.iter().filter(|n| !n.seeds.is_empty()).cloned().collect(),
            tasks: plan.needles.iter().enumerate().filter_map(task).collect(),
            implant: Some(plan),
            compensations: BTreeMap::new(),
            stabilising: Vec::new(),
        })
    }

    /// Chooses that many stabilising needles, as far apart as the template allows. Reports if there
    /// is room for fewer.
    pub fn stabilise(&mut self, scene: &SceneModel, count: usize) -> Result<(), ProcedureError> {
        let anatomy = Anatomy::of(scene)?;
        let (template, needles) = match &self.implant {
            Some(plan) => (plan.template, &plan.needles),
            None => (Template::before(&scene.header), &self.needles),
        };
        self.stabilising = stabilising(&template, &anatomy, needles, count);
        let holes: Vec<String> = self.stabilising.iter().map(|s| s.hole.to_string()).collect();
        println!(
            "stabilising needles: {}",
            if holes.is_empty() {
                "none".to_owned()
            } else {
                holes.join(", ")
            }
        );
        if holes.len() < count {
            println!("note: no more holes are clear of the plan's needles and of spared structures");
        }
        Ok(())
    }

    /// Rehearses every needle and shifts its drops so that the seeds rest on plan.
    pub fn compensate(&mut self, link: &mut Link, pace: &Pace, interrupted: &Interrupt) -> Result<(), ProcedureError> {
        let count = self.tasks.len();
        let beside: Vec<_> = self.stabilising.iter().map(|s| s.needle).collect();
        // Later needles find the effects of earlier ones on those that stay in.
        let mut earlier = Vec::new();
        for (number, task) in self.tasks.iter_mut().enumerate() {
            let mut rehearser = LinkRehearser {
                link,
                interrupted,
                stabilising: &beside,
                earlier: &earlier,
            };
            let done = match compensate(&self.needles[number], pace, &Limits::default(), &mut rehearser) {
                Ok(done) => done,
                Err(why) if interrupted.asked() => return Err(why.into()),
                Err(why) => {
                    println!("note: needle {} of {count} is not compensated: {why}", number + 1);
                    earlier.push(task.drops.pass());
                    continue;
                }
            };
            let [[before, _], [after, _]] = summary_m(std::slice::from_ref(&done));
            let as_planned = match done.before_m {
                Some(_) => format!("{:.2} mm", before * 1e3),
                None => "not possible".to_owned(),
            };
            println!(
                "needle {} of {count} rehearsed {} times: mean error as planned {as_planned}, compensated {:.2} mm",
                number + 1,
                done.rehearsals,
                after * 1e3
            );
            for found in &done.sensitive {
                println!("note: needle {} of {count}: {found}", number + 1);
            }
            task.drops.clone_from(&done.drops);
            earlier.push(task.drops.pass());
            self.compensations.insert(number, done);
        }
        Ok(())
    }

    /// Returns the planned seeds in the order of the drops.
    pub fn planned(&self) -> Vec<PlannedDrop> {
        let of_task = |(number, task): (usize, &NeedleTask)| {
            let needle = &self.needles[number];
            let rehearsed = self.compensations.get(&number);
            let drop = |(i, planned_m): (usize, [f64; 3])| PlannedDrop {
                rehearsed_m: rehearsed
                    .and_then(|c| c.after_m.get(i))
                    .map(|off_m| [0, 1, 2].map(|a| planned_m[a] + off_m[a])),
                needle: number,
                hole: needle.hole,
                planned_m,
                direction: task.plan.direction,
                strength_u: self.implant.as_ref().map(|_| needle.seeds[i].strength_u),
            };
            task.plan
                .seeds_m
                .iter()
                .copied()
                .enumerate()
                .map(drop)
                .collect::<Vec<_>>()
        };
        self.tasks.iter().enumerate().flat_map(of_task).collect()
    }
}

/// Returns a needle without a template, in the form of a plan.
fn needle_of(plan: &PlannedNeedle) -> Needle {
    let along = plan.seeds_m.iter().map(|seed| plan.along_m(*seed));
    Needle {
        hole: None,
        entry_m: plan.entry_m,
        direction: plan.direction,
        depth_m: 0.0,
        retract_to_m: 0.0,
        loading: crate::plan::Loading::Loose,
        seeds: along
            .map(|along_m| crate::plan::NeedleSeed {
                along_m,
                strength_u: 0.0,
            })
            .collect(),
    }
    .in_order()
}
