//! One needle in the scene `paper`, rehearsed as often as a caller wants to measure.

use std::sync::atomic::AtomicBool;
use stylet_hw::DeviceInfo;
use stylet_runtime::rehearse::Stage;
use stylet_shm_schema::{NeedleRehearsal, ParameterSet};
use stylet_sim::scene::{Scene, SceneSource, TissueKind};

/// A body, and the needle that goes into it.
pub struct Bench {
    stage: Stage,
    run: NeedleRehearsal,
}

impl Bench {
    /// Prepares the body, and rehearses once, which solves for the needle's line.
    ///
    /// # Panics
    /// If the built-in scene cannot be rehearsed in.
    pub fn new(tissue: TissueKind) -> Self {
        let source = SceneSource::Builtin("paper".to_owned());
        let scene = Scene::builtin("paper").expect("built in");
        let (low, high) = scene.lattice.bounds_m();
        let (x, y) = ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0);
        let at = |share: f64| [x, y, low[2] + share * (high[2] - low[2])];
        let mut bench = Self {
            stage: Stage::build(&source, tissue, DeviceInfo::phantom_premium_1_5()).expect("built in"),
            run: NeedleRehearsal {
                entry_m: [x, y, low[2] - 0.01],
                direction: [0.0, 0.0, 1.0],
                insert_m_per_s: 0.05,
                retract_m_per_s: 0.05,
                approach_m_per_s: 0.1,
                acceleration_m_per_s2: 2.0,
                retract_to_m: 0.0,
                strand_pitch_m: None,
                stabilising: Vec::new(),
                earlier: Vec::new(),
                as_points: false,
                drops_m: [0.8, 0.65, 0.5, 0.35, 0.2].map(at).to_vec(),
            },
        };
        bench.rehearse();
        bench
    }

    /// Returns the number of force ticks; each fifth has a tick of the tissue with it.
    ///
    /// # Panics
    /// If the needle does not go through.
    pub fn rehearse(&mut self) -> f64 {
        let never = AtomicBool::new(false);
        let done = self.stage.rehearse(&self.run, &ParameterSet::default(), &never);
        (1e3 * done.expect("goes through").simulated_s).round()
    }
}
