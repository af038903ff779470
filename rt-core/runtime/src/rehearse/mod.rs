//! A needle gone through ahead of time: the two loops of the run, in a body of their own, as fast as they can.
//!
//! Nothing is modelled anew: the simulated hand and device, `HapticLoop::tick` and `TissueLoop::tick` are those of the live
//! run, fed with a time that does not wait. Each rehearsal begins with tissue at rest, and the same needle gives the same bytes.
//! Runs on a thread of normal priority (`bridge/rehearsals.rs`).

mod rig;
mod script;

use crate::rt::world::World;
use nalgebra::Vector3;
use rig::Rig;
use script::Script;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::script::{TISSUE_REST_FOR, TISSUE_REST_LIMIT, TISSUE_REST_M};
use stylet_shm_schema::{Fault, MAX_SEEDS, ParameterSet, Reason, Refusal, RefusalCode, SeedPose, flags};
use stylet_sim::active::activate;
use stylet_sim::scene::SceneSource;
use stylet_sim::scene::TissueKind;

/// A rehearsal that takes longer than this, in its own time, has failed.
const LONGEST_S: f64 = 900.0;

/// One needle, scene frame, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct NeedleRun {
    pub entry_m: Vector3<f64>,
    pub direction: Vector3<f64>,
    pub insert_m_per_s: f64,
    pub retract_m_per_s: f64,
    pub approach_m_per_s: f64,
    pub acceleration_m_per_s2: f64,
    /// How far from the entry the tip is drawn back to.
    pub retract_to_m: f64,
    /// In the order of the drops.
    pub drops_m: Vec<Vector3<f64>>,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Rehearsed {
    /// In the order of the drops, after the tissue has come to rest.
    pub seeds: Vec<SeedPose>,
    /// When each was dropped, after the tip's first contact with tissue.
    pub dropped_after_s: Vec<f64>,
    pub peak_force_n: f64,
    pub displacement_before_puncture_m: f64,
    pub simulated_s: f64,
}

/// Why a rehearsal did not come to its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RehearseError {
    /// A loop refused an order.
    #[error("{}", why.message())]
    Refused {
        why: RefusalCode,
        /// Number of the drop, from 0, that was refused or was to come next.
        drop: u32,
    },
    #[error("{0}")]
    Other(String),
}

impl From<String> for RehearseError {
    fn from(why: String) -> Self {
        Self::Other(why)
    }
}

impl From<RehearseError> for Refusal {
    fn from(error: RehearseError) -> Self {
        let (code, subject) = match error {
            RehearseError::Refused { why, drop } => (why, drop),
            RehearseError::Other(_) => (RefusalCode::RehearsalFailed, Reason::NO_SUBJECT),
        };
        Refusal {
            reasons: vec![Reason::new(code, subject)],
            text: error.to_string(),
        }
    }
}

/// A body to rehearse in; kept from one rehearsal to the next.
pub struct Stage {
    world: Option<Box<World>>,
    device: DeviceInfo,
}

impl Stage {
    /// Builds the scene anew, apart from the one that runs.
    pub fn build(source: &SceneSource, tissue: TissueKind, device: DeviceInfo) -> Result<Self, String> {
        let mut scene = source.build().map_err(|e| e.to_string())?;
        scene.tissue = tissue;
        let active = activate(&ParameterSet::default(), &device).map_err(|p| p.to_string())?;
        let world = World::new(scene, active.limits, 1)?;
        Ok(Self {
            world: Some(Box::new(world)),
            device,
        })
    }

    /// From rest, under these parameters; ends early, with an error, when `stop` is set.
    pub fn rehearse(
        &mut self,
        run: &NeedleRun,
        set: &ParameterSet,
        stop: &AtomicBool,
    ) -> Result<Rehearsed, RehearseError> {
        if run.drops_m.len() > MAX_SEEDS {
            return Err(format!("{} drops; at most {MAX_SEEDS}", run.drops_m.len()).into());
        }
        let active = activate(set, &self.device).map_err(|p| p.to_string())?;
        let mut world = self
            .world
            .take()
            .ok_or_else(|| "the last rehearsal lost its body".to_owned())?;
        world.tissue.return_to_rest();
        world.set_limits(active.limits.clone());
        let mut rig = Rig::new(world, &active, &self.device, run);
        let outcome = perform(&mut rig, run, stop);
        self.world = Some(rig.into_world());
        outcome
    }
}

fn perform(rig: &mut Rig, run: &NeedleRun, stop: &AtomicBool) -> Result<Rehearsed, RehearseError> {
    let mut script = Script::new(run);
    let mut displacement_before_puncture_m = 0.0_f64;
    let (mut punctured, mut contact_s) = (false, None);
    let mut dropped_after_s = Vec::new();
    while rig.seconds() < LONGEST_S {
        // SYNC: set by the bridge when it ends; nothing but the flag is carried.
        if stop.load(Ordering::Relaxed) {
            return Err("rt-core ended during the rehearsal".to_owned().into());
        }
        rig.tick();
        let state = rig.state();
        if state.flags & flags::IN_CONTACT != 0 {
            contact_s.get_or_insert(rig.seconds());
        }
        while dropped_after_s.len() < state.seed_count as usize {
            dropped_after_s.push(rig.seconds() - contact_s.unwrap_or(rig.seconds()));
        }
        punctured |= state.flags & flags::PUNCTURED != 0;
        if !punctured {
            displacement_before_puncture_m = displacement_before_puncture_m.max(rig.displacement_m());
        }
        let fault = Fault::from_number(state.fault).unwrap_or(Fault::None);
        if fault != Fault::None {
            return Err(format!("in the rehearsal the force went off: {}", fault.message()).into());
        }
        if script.advance(rig)? {
            let simulated_s = rig.seconds();
            return Ok(Rehearsed {
                seeds: rig.seeds(),
                dropped_after_s,
                peak_force_n: rig.state().peak_force_n,
                displacement_before_puncture_m,
                simulated_s,
            });
        }
    }
    Err(format!("the needle was not through after {LONGEST_S} s of its own time").into())
}

/// Wall-clock beside the result, for the host.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let begun = Instant::now();
    let done = work();
    (done, begun.elapsed().as_nanos() as u64)
}

#[cfg(test)]
mod tests;
