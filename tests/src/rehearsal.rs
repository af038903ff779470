//! Rehearsals without processes: the core's own, called from the host's planner.

use std::sync::atomic::AtomicBool;
use stylet_host::link::SceneModel;
use stylet_hw::DeviceInfo;
use stylet_implant::plan::rehearse::{Drops, RehearsalError, Rehearser, Rest};
use stylet_implant::workflow::Pace;
use stylet_runtime::control::ScenePicture;
use stylet_runtime::rehearse::{RehearseError, Stage};
use stylet_shm_schema::{NeedleRehearsal, ParameterSet};
use stylet_sim::scene::TissueKind;
use stylet_sim::scene::{Labels, Scene, SceneSource};

/// A scene with a body to rehearse in, and a host's view of it.
pub struct Theatre {
    pub scene: SceneModel,
    stage: Stage,
    pub rehearsals: usize,
}

impl Theatre {
    pub fn builtin(name: &str) -> Self {
        let scene = Scene::builtin(name).expect("built in");
        Self::of(&scene, &SceneSource::Builtin(name.to_owned()))
    }

    pub fn of_labels(name: &str, labels: &Labels) -> Self {
        let scene = Scene::from_labels(name, labels).expect("labels of a test are valid");
        Self::of(&scene, &SceneSource::of_labels(name, labels))
    }

    fn of(scene: &Scene, source: &SceneSource) -> Self {
        let picture = ScenePicture::first(scene, 1);
        let (header, words) = picture.parts();
        let device = DeviceInfo::phantom_premium_1_5();
        let mut stage = Stage::build(source, TissueKind::ChainMail, device).expect("the scene was built before");
        // As in the core.
        stage.seeds_and_forces_alone();
        Self {
            scene: SceneModel::of_words(header, words).expect("the core's own picture holds together"),
            stage,
            rehearsals: 0,
        }
    }
}

impl Rehearser for Theatre {
    fn rehearse(&mut self, drops: &Drops, pace: &Pace, as_points: bool) -> Result<Rest, RehearsalError> {
        self.rehearsals += 1;
        let run = NeedleRehearsal {
            entry_m: drops.entry_m,
            direction: drops.direction,
            insert_m_per_s: pace.insert_m_per_s,
            retract_m_per_s: pace.retract_m_per_s,
            approach_m_per_s: pace.approach_m_per_s,
            acceleration_m_per_s2: pace.acceleration_m_per_s2,
            retract_to_m: drops.retract_to_m,
            strand_pitch_m: drops.strand_pitch_m,
            stabilising: Vec::new(),
            earlier: Vec::new(),
            as_points,
            drops_m: drops.drops_m().collect(),
        };
        let done = self
            .stage
            .rehearse(&run, &ParameterSet::default(), &AtomicBool::new(false))
            .map_err(|e| RehearsalError::Refused {
                text: e.to_string(),
                drop: match e {
                    RehearseError::Refused { drop, .. } => Some(drop as usize),
                    _ => None,
                },
            })?;
        Ok(Rest {
            seeds_m: done.seeds.iter().map(|s| s.position_m).collect(),
            dropped_at_m: done.seeds.iter().map(|s| s.dropped_at_m).collect(),
            dropped_after_s: done.dropped_after_s,
            peak_force_n: done.peak_force_n,
            displacement_before_puncture_m: done.displacement_before_puncture_m,
        })
    }
}
