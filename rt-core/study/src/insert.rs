//! The insertions of one implant, needle by needle, each in tissue at rest.

use crate::definition::Study;
use crate::draw::{Drawn, Implant};
use crate::error::StudyError;
use crate::plan::{Needle, Plan};
use crate::quantity::Id;
use nalgebra::{Unit, Vector3};
use std::sync::atomic::AtomicBool;
use stylet_hw::{DeviceInfo, Hand};
use stylet_insertions::{Insertion, Motion, Rest, Seed};
use stylet_procedure::Pace;
use stylet_runtime::rehearse::{RehearseError, Rehearsed, Stage};
use stylet_shm_schema::{NeedleRehearsal, ParameterSet};
use stylet_sim::scene::SceneSource;

/// A body that is kept from one implant to the next where both have the same.
#[derive(Default)]
pub struct Body(Option<(Key, Stage)>);

#[derive(PartialEq)]
struct Key {
    scene: String,
    stiffness_bits: u64,
}

impl Body {
    fn stage(&mut self, study: &Study, scene: &str, stiffness: f64) -> Result<&mut Stage, StudyError> {
        let key = Key {
            scene: scene.to_owned(),
            stiffness_bits: stiffness.to_bits(),
        };
        if self.0.as_ref().is_none_or(|(kept, _)| *kept != key) {
            // The old one is freed first: bodies are large.
            self.0 = None;
            let source = SceneSource::Builtin(scene.to_owned()).stiffened(stiffness)?;
            let stage = Stage::build(&source, study.tissue, DeviceInfo::phantom_premium_1_5());
            let mut stage = stage.map_err(|why| StudyError::Body {
                scene: scene.to_owned(),
                stiffness,
                why,
            })?;
            if study.is_linear {
                stage.seeds_and_forces_alone();
            }
            return Ok(&mut self.0.insert((key, stage)).1);
        }
        match &mut self.0 {
            Some((_, stage)) => Ok(stage),
            None => unreachable!("built above where there was none"),
        }
    }
}

/// Inserts all needles of an implant; `None` where `stop` ended it. `done` is called after each needle.
pub fn implant(
    body: &mut Body,
    study: &Study,
    implant: Implant,
    stop: &AtomicBool,
    mut done: impl FnMut(&Insertion),
) -> Result<Option<Vec<Insertion>>, StudyError> {
    let gland = implant.gland(study);
    let mut rows = Vec::new();
    for (n, needle) in gland.plan.needles.iter().enumerate() {
        let drawn = Drawn::of(study, implant, n);
        let stage = body.stage(study, &gland.scene, drawn.get(Id::Stiffness))?;
        stage.take_hand(Hand {
            mass_kg: drawn.get(Id::HandMass),
            damping_n_s_per_m: drawn.get(Id::HandDamping),
            stiffness_n_per_m: drawn.get(Id::HandStiffness),
            ..Hand::steady()
        });
        let mut set = ParameterSet::default();
        for ((spec, _), &value) in study.parameters.iter().zip(drawn.parameters()) {
            // The factor to a person's unit and back may leave the limits by a bit.
            set.set(spec.id, (value / spec.display_per_si).clamp(spec.min, spec.max));
        }
        let outcome = match stage.rehearse(&run(needle, &drawn), &set, stop) {
            Err(RehearseError::Stopped) => return Ok(None),
            outcome => outcome,
        };
        let row = Insertion {
            id: implant.id_of_needle(study, n),
            scene: gland.scene.clone(),
            plan: gland.plan_name.clone(),
            implant: implant.number as i32,
            needle: n as i32 + 1,
            hole: needle.hole.clone(),
            tissue: study.tissue.name().to_owned(),
            drawn: drawn.values,
            ..result(&gland.plan, needle, &outcome)
        };
        done(&row);
        rows.push(row);
    }
    Ok(Some(rows))
}

/// Returns the needle as really held: at the template's hole by what misses it, turned about its entry.
fn run(needle: &Needle, drawn: &Drawn) -> NeedleRehearsal {
    let (right, anterior) = across(&needle.direction);
    let missed_mm = right * drawn.get(Id::EntryRight) + anterior * drawn.get(Id::EntryAnterior);
    let tilt = |id: Id| drawn.get(id).to_radians().tan();
    let turned = *needle.direction + right * tilt(Id::TiltRight) + anterior * tilt(Id::TiltAnterior);
    let direction = turned.normalize();
    let entry_m = (needle.entry_mm + missed_mm) * 1e-3;
    let pace = Pace::default();
    NeedleRehearsal {
        entry_m: entry_m.into(),
        direction: direction.into(),
        insert_m_per_s: drawn.get(Id::Insert) * 1e-3,
        retract_m_per_s: drawn.get(Id::Retract) * 1e-3,
        approach_m_per_s: pace.approach_m_per_s,
        acceleration_m_per_s2: pace.acceleration_m_per_s2,
        retract_to_m: needle.retract_to_mm * 1e-3,
        strand_pitch_m: needle.strand_pitch_mm.map(|pitch| pitch * 1e-3),
        stabilising: Vec::new(),
        earlier: Vec::new(),
        as_points: false,
        drops_m: needle
            .seeds
            .iter()
            .map(|(along_mm, _)| (entry_m + direction * (along_mm * 1e-3)).into())
            .collect(),
    }
}

/// Returns unit vectors across a needle, as near to the patient's right and front as they can be.
fn across(direction: &Unit<Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let along = direction.into_inner();
    let without = |axis: Vector3<f64>| axis - along * along.dot(&axis);
    // A needle from the side has no right across it: its front counts, and what is left.
    let anterior = without(Vector3::y())
        .try_normalize(1e-3)
        .unwrap_or_else(|| without(Vector3::z()).normalize());
    (anterior.cross(&along).normalize(), anterior)
}

/// Returns the part of a row that follows from the outcome.
fn result(plan: &Plan, needle: &Needle, outcome: &Result<Rehearsed, RehearseError>) -> Insertion {
    let mm = |m: f64| m * 1e3;
    let motion = |done: &Rehearsed| Motion {
        peak_force_n: done.peak_force_n,
        displacement_before_puncture_mm: mm(done.displacement_before_puncture_m),
        largest_displacement_mm: mm(done.largest_displacement_m),
        target_shift_mm: mm(done.target_shift_m),
        duration_s: done.simulated_s,
    };
    let seeds = needle.seeds.iter().enumerate().map(|(n, &(along_mm, strength_u))| {
        let rest = outcome.as_ref().ok().and_then(|done| {
            let (seed, &dropped_after_s) = (done.seeds.get(n)?, done.dropped_after_s.get(n)?);
            Some(Rest {
                at_mm: seed.position_m.map(mm),
                axis: seed.axis,
                dropped_after_s,
            })
        });
        Seed {
            planned_mm: (needle.entry_mm + *needle.direction * along_mm).into(),
            planned_axis: needle.direction.into_inner().into(),
            strength_u,
            rest,
        }
    });
    Insertion {
        id: String::new(),
        scene: String::new(),
        plan: String::new(),
        implant: 0,
        needle: 0,
        hole: String::new(),
        tissue: String::new(),
        source: plan.source.clone(),
        prescription_gy: plan.prescription_gy,
        drawn: Vec::new(),
        seeds: seeds.collect(),
        outcome: outcome.as_ref().map(motion).map_err(ToString::to_string),
    }
}
