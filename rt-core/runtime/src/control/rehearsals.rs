//! Runs rehearsals for hosts: one at a time, in the background, while the scene keeps running.

use crate::background::{Task, Work};
use crate::rehearse::{RehearseError, Rehearsed, Stage};
use crate::rt::clock;
use crate::rt::exchange::Ticket;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_hw::DeviceInfo;
use stylet_shm_schema::{MAX_SEEDS, NeedleRehearsal, ParameterSet, Refusal, RefusalCode, Rehearsal};
use stylet_sim::scene::SceneSource;
use stylet_sim::tissue::TissueSpec;

const PANICKED: &str = "the rehearsal stopped with an internal fault; the output of rt-core says where. The next one starts with a new state";

/// Result of the thread.
struct Finished {
    scene_generation: u64,
    wall_ns: u64,
    outcome: Result<Rehearsed, RehearseError>,
    /// Stage kept for the next rehearsal.
    stage: Option<Stage>,
}

/// A finished rehearsal.
pub struct Ended {
    pub ticket: Ticket,
    pub outcome: Result<Box<Rehearsal>, Refusal>,
}

/// The control thread's side of rehearsals.
pub struct RehearsalRunner {
    source: Arc<SceneSource>,
    tissue: TissueSpec,
    device: DeviceInfo,
    work: Work,
    /// Body of the running scene; `None` before its first rehearsal, and while one runs.
    stage: Option<(u64, Stage)>,
    under_way: Option<(Ticket, Task<Finished>)>,
}

impl RehearsalRunner {
    pub fn new(source: Arc<SceneSource>, tissue: TissueSpec, device: DeviceInfo, work: Work) -> Self {
        Self {
            source,
            tissue,
            device,
            work,
            stage: None,
            under_way: None,
        }
    }

    /// Switches to another scene; a running rehearsal ends in the scene that it began in.
    pub fn change_scene(&mut self, source: Arc<SceneSource>) {
        self.source = source;
        self.stage = None;
    }

    /// Begins a rehearsal, unless another runs.
    pub fn begin(
        &mut self,
        ticket: Ticket,
        run: NeedleRehearsal,
        set: ParameterSet,
        scene_generation: u64,
    ) -> Result<(), Refusal> {
        if self.under_way.is_some() {
            return Err(RefusalCode::RehearsalRunning.into());
        }
        let kept = self
            .stage
            .take()
            .filter(|(generation, _)| *generation == scene_generation);
        let (source, tissue, device) = (Arc::clone(&self.source), self.tissue, self.device);
        let work = move |stop: &AtomicBool| {
            let stage = kept.map_or_else(|| Stage::build(&source, tissue, device), |(_, stage)| Ok(stage));
            let (stage, outcome, wall_ns) = match stage {
                Ok(mut stage) => {
                    stage.seeds_and_forces_alone();
                    let begun_ns = clock::now_ns();
                    let outcome = stage.rehearse(&run, &set, stop);
                    (Some(stage), outcome, clock::now_ns() - begun_ns)
                }
                Err(why) => (None, Err(why), 0),
            };
            Finished {
                scene_generation,
                wall_ns,
                outcome,
                stage,
            }
        };
        let task = Task::spawn("rehearsal", self.work, work);
        let failed = |_| Refusal::new(RefusalCode::Internal, "no thread could be started to rehearse");
        self.under_way = Some((ticket, task.map_err(failed)?));
        Ok(())
    }

    /// Returns a rehearsal that has ended since the last call.
    pub fn take(&mut self, scene_generation: u64) -> Option<Ended> {
        let (ticket, task) = self.under_way.take_if(|(_, task)| task.is_finished())?;
        let Some(finished) = task.result() else {
            let outcome = Err(Refusal::new(RefusalCode::Internal, PANICKED));
            return Some(Ended { ticket, outcome });
        };
        if finished.scene_generation == scene_generation {
            self.stage = finished.stage.map(|stage| (scene_generation, stage));
        }
        Some(Ended {
            ticket,
            outcome: finished
                .outcome
                .map(|r| message(&r, finished.scene_generation, finished.wall_ns))
                .map_err(Refusal::from),
        })
    }
}

fn message(r: &Rehearsed, scene_generation: u64, wall_ns: u64) -> Box<Rehearsal> {
    let mut message: Box<Rehearsal> = Box::new(bytemuck::Zeroable::zeroed());
    message.scene_generation = scene_generation;
    message.simulated_ns = (r.simulated_s * 1e9) as u64;
    message.wall_ns = wall_ns;
    message.peak_force_n = r.peak_force_n;
    message.displacement_before_puncture_m = r.displacement_before_puncture_m;
    message.deflection_m = r.deflection_m;
    message.seed_count = r.seeds.len().min(MAX_SEEDS) as u64;
    for (slot, seed) in message.seeds.iter_mut().zip(&r.seeds) {
        *slot = *seed;
    }
    for (slot, after_s) in message.dropped_after_ns.iter_mut().zip(&r.dropped_after_s) {
        *slot = (after_s * 1e9) as u64;
    }
    message
}
