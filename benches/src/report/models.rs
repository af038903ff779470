//! The models that are compared, each under the settings that it is compared with.

use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::{ChainMailTissue, FemTissue, TissueModel};

/// One model under one setting.
pub struct Entry {
    pub model_name: &'static str,
    pub setting: String,
    pub model: Box<dyn TissueModel>,
}

/// Relative tolerances of FEM.
const TOLERANCES: [f64; 5] = [1e-1, 3e-2, 1e-2, 1e-3, 1e-4];
/// Tolerance of what counts as converged.
const CONVERGED: f64 = 1e-9;

/// Makes FEM in f64, far beyond the accuracy of anything it is compared with.
pub fn converged(scene: &Scene) -> FemTissue<f64> {
    let mut fem = FemTissue::<f64>::new(scene).expect("valid materials");
    (fem.settings.relative_tolerance, fem.settings.max_cycles) = (CONVERGED, 10_000);
    fem
}

pub fn entries(scene: &Scene) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut add = |model_name, setting: String, model: Box<dyn TissueModel>| {
        entries.push(Entry {
            model_name,
            setting,
            model,
        });
    };
    let limits = TissueParameters::default().validate().expect("the defaults are valid");
    add(
        "ChainMail, solved",
        "paper's limits".to_owned(),
        Box::new(ChainMailTissue::new(scene, limits)),
    );
    for tolerance in TOLERANCES {
        let mut fem = FemTissue::<f32>::new(scene).expect("valid materials");
        fem.settings.relative_tolerance = tolerance;
        fem.settings.max_cycles = 200;
        add("FEM, f32", format!("tolerance {tolerance:.0e}"), Box::new(fem));
    }
    let live = FemTissue::<f32>::new(scene).expect("valid materials");
    add(
        "FEM, f32",
        "as off its line: one cycle a tick".to_owned(),
        Box::new(live),
    );
    for tolerance in [1e-3, 1e-6] {
        let mut fem = FemTissue::<f64>::new(scene).expect("valid materials");
        (fem.settings.relative_tolerance, fem.settings.max_cycles) = (tolerance, 1000);
        add("FEM, f64", format!("tolerance {tolerance:.0e}"), Box::new(fem));
    }
    entries
}
