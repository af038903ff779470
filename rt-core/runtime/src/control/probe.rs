//! Solves in the background for the answers of the ultrasound probe, once per scene of a run whose second hand holds
//! it.

use crate::background::{Task, Work, goes_on};
use crate::lines::{LineBody, NoProbe};
use crate::rt::exchange::TissueOrder;
use crate::rt::outside::OutsideTape;
use crate::rt::probe_tape::ProbeTape;
use crate::rt::wiring::ControlPorts;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stylet_sim::probe::{BodyProbe, NoWall, ProbeShape};
use stylet_sim::scene::SceneSource;
use stylet_sim::tissue::TissueSpec;

/// A probe, and its report to the user.
type Found = (BodyProbe, Option<String>);

/// The control thread's side of the probe.
pub struct ProbePreparer {
    source: Arc<SceneSource>,
    tissue: TissueSpec,
    /// Folder of saved answers, which took minutes to solve.
    kept_in: Option<PathBuf>,
    under_way: Option<(u64, Task<Result<Found, NoProbe>>)>,
    /// The scene has its probe, or cannot have one.
    is_settled: bool,
    /// The force loop has room to record the probe's effect on its line.
    has_sent_room: bool,
    work: Work,
}

impl ProbePreparer {
    pub fn new(source: Arc<SceneSource>, tissue: TissueSpec, kept_in: Option<PathBuf>, work: Work) -> Self {
        Self {
            source,
            tissue,
            kept_in,
            under_way: None,
            is_settled: false,
            has_sent_room: false,
            work,
        }
    }

    /// Switches to another scene.
    pub fn change_scene(&mut self, source: Arc<SceneSource>) {
        self.source = source;
        self.is_settled = false;
        if let Some((_, task)) = &self.under_way {
            task.stop();
        }
    }

    /// Frees returned memory, hands over a finished probe, and begins a missing one. Returns its report once.
    pub(super) fn pass(&mut self, scene_generation: u64, loops: &mut ControlPorts) -> Option<String> {
        while loops.old_probes.pop().is_ok() {}
        if self.is_settled {
            return None;
        }
        let Some((generation, task)) = self.under_way.take_if(|(_, task)| task.is_finished()) else {
            if self.under_way.is_none() {
                self.begin(scene_generation);
            }
            return None;
        };
        if generation != scene_generation {
            return None;
        }
        self.is_settled = true;
        match task.result() {
            Some(Ok((probe, said))) => {
                if !std::mem::replace(&mut self.has_sent_room, true) {
                    let _ = loops.outside_rooms.push(OutsideTape::new());
                }
                let _ = loops.tissue_orders.push(TissueOrder::Probe {
                    generation: scene_generation,
                    room: ProbeTape::new(&probe),
                    probe: Box::new(probe),
                });
                said
            }
            Some(Err(why)) => Some(format!("the probe presses nothing in this scene: {why}")),
            None => Some("the probe presses nothing: the thread that solved for it has panicked".to_owned()),
        }
    }

    fn begin(&mut self, scene_generation: u64) {
        let (source, tissue, kept_in) = (Arc::clone(&self.source), self.tissue, self.kept_in.clone());
        let work = move |stop: &AtomicBool| {
            let body = LineBody::of_source(&source, tissue)?.ok_or(NoWall::NoForces)?;
            find(&body, &source, kept_in.as_deref(), &mut |_| goes_on(stop))
        };
        // The thread could not be started; the next pass tries again.
        self.under_way = Task::spawn("probe", self.work, work)
            .ok()
            .map(|task| (scene_generation, task));
    }
}

/// Returns the scene's saved answers, or solves the coarse ones within seconds.
fn find(
    body: &LineBody,
    source: &SceneSource,
    kept_in: Option<&Path>,
    goes_on: &mut dyn FnMut([usize; 2]) -> bool,
) -> Result<Found, NoProbe> {
    let shape = ProbeShape::default();
    let kept = kept_in.map(|folder| body.kept_probe(shape, folder)).transpose();
    let mut said = None;
    match kept.map(Option::flatten) {
        Ok(Some(probe)) => return Ok((probe, said)),
        Ok(None) => {}
        Err(why) => said = Some(format!("the probe that was kept is not used: {why}")),
    }
    let probe = body.prepare_probe(shape, goes_on)?;
    let [edge_mm, fine_mm] = body.probe_edges_m().map(|edge_m| 1e3 * edge_m);
    if edge_mm > 1.01 * fine_mm {
        said.get_or_insert_with(|| {
            format!(
                "the probe is solved for in elements of {edge_mm:.1} mm: in 'pelvis' its press is 10 to 15 % too strong. {} solves in cells of \
                 {fine_mm:.1} mm once, for minutes, and later runs use that",
                command_for(source)
            )
        });
    }
    Ok((probe, said))
}

/// Command line that solves for a scene's probe.
fn command_for(source: &SceneSource) -> String {
    match source {
        SceneSource::Builtin(name) => format!("'rt-core probe --scene {name}'"),
        SceneSource::Labels { .. } => {
            "'rt-core probe --flight FILE', with a flight recording of this scene,".to_owned()
        }
    }
}
