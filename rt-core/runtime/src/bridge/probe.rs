//! What the ultrasound probe can press is solved for beside the loops, once for each scene of a run whose second hand holds it.

use super::notices::LoopRings;
use crate::lines::{LineBody, NoLine};
use crate::rt::exchange::TissueOrder;
use crate::rt::outside::OutsideTape;
use crate::rt::probe_tape::ProbeTape;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use stylet_sim::probe::{BodyProbe, NoWall, ProbeShape};
use stylet_sim::scene::{SceneSource, TissueKind};

/// Why there is no probe; the text is for people.
#[derive(Debug, thiserror::Error)]
enum NoProbe {
    #[error(transparent)]
    Body(#[from] NoLine),
    #[error(transparent)]
    Wall(#[from] NoWall),
}

struct Task {
    scene_generation: u64,
    thread: JoinHandle<Result<BodyProbe, NoProbe>>,
    stop: Arc<AtomicBool>,
}

/// The bridge's side of the probe.
pub struct ProbePreparer {
    source: Arc<SceneSource>,
    tissue: TissueKind,
    under_way: Option<Task>,
    /// The scene has its probe, or has none.
    is_settled: bool,
    /// The force loop has room to record what probes do to its line.
    has_sent_room: bool,
}

impl ProbePreparer {
    pub fn new(source: Arc<SceneSource>, tissue: TissueKind) -> Self {
        Self {
            source,
            tissue,
            under_way: None,
            is_settled: false,
            has_sent_room: false,
        }
    }

    /// Another scene runs.
    pub fn change_scene(&mut self, source: Arc<SceneSource>) {
        self.source = source;
        self.is_settled = false;
        self.give_up();
    }

    /// Frees what came back, hands over what is ready, and begins what is missing. Why a scene has no probe, once.
    pub(super) fn pass(&mut self, scene_generation: u64, loops: &mut LoopRings) -> Option<String> {
        while loops.old_probes.pop().is_ok() {}
        if self.is_settled {
            return None;
        }
        let Some(task) = self.under_way.take_if(|task| task.thread.is_finished()) else {
            if self.under_way.is_none() {
                self.begin(scene_generation);
            }
            return None;
        };
        if task.scene_generation != scene_generation {
            return None;
        }
        self.is_settled = true;
        match task.thread.join() {
            Ok(Ok(probe)) => {
                if !std::mem::replace(&mut self.has_sent_room, true) {
                    let _ = loops.outside_rooms.push(OutsideTape::new());
                }
                let _ = loops.tissue_orders.push(TissueOrder::Probe {
                    generation: scene_generation,
                    room: ProbeTape::new(&probe),
                    probe: Box::new(probe),
                });
                None
            }
            Ok(Err(why)) => Some(why.to_string()),
            Err(_) => Some("the thread that solved for the probe has panicked".to_owned()),
        }
    }

    fn begin(&mut self, scene_generation: u64) {
        let (source, tissue) = (Arc::clone(&self.source), self.tissue);
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let work = move || {
            let body = LineBody::of_source(&source, tissue)?.ok_or(NoWall::NoForces)?;
            // SYNC: nothing but the flag is carried.
            Ok(body.prepare_probe(ProbeShape::default(), &mut |_| !stopped.load(Ordering::Relaxed))?)
        };
        // Without a thread there is no probe; it is tried again at the next pass.
        if let Ok(thread) = std::thread::Builder::new().name("probe".to_owned()).spawn(work) {
            self.under_way = Some(Task {
                scene_generation,
                thread,
                stop,
            });
        }
    }

    fn give_up(&mut self) {
        if let Some(task) = &self.under_way {
            // SYNC: read by the thread; nothing but the flag is carried.
            task.stop.store(true, Ordering::Relaxed);
        }
    }
}

impl Drop for ProbePreparer {
    fn drop(&mut self) {
        self.give_up();
    }
}
