//! The tissue models under test, and their bodies.

use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::{Labels, Scene, Structure, TissueKind};
use stylet_sim::tissue::{FemTissue, TissueModel, TissueSpec};

/// Returns every built-in model but `Paper`, whose needle alone differs from that of ChainMail.
pub fn kinds() -> Vec<TissueKind> {
    TissueKind::ALL
        .into_iter()
        .filter(|kind| *kind != TissueKind::Paper)
        .collect()
}

/// Returns the name of a model on the page.
pub fn name(kind: TissueKind) -> &'static str {
    match kind {
        TissueKind::ChainMail => "ChainMail",
        TissueKind::Fem => "FEM",
        other => other.name(),
    }
}

pub fn on(kind: TissueKind, scene: &Scene, parameters: &TissueParameters) -> Box<dyn TissueModel> {
    if kind == TissueKind::Fem {
        let mut fem = FemTissue::<f32>::new(scene).expect("the case gives valid materials");
        // The solver's capability, not its time in the loop.
        fem.settings.max_cycles = 40;
        return Box::new(fem);
    }
    let limits = parameters.validate().expect("the case gives valid settings");
    (TissueSpec::from(kind).build)(scene, &limits).expect("the case gives a valid scene")
}

/// Builds a body from a formula; its label numbers the structure, 0 is no tissue.
pub fn body(dims: [usize; 3], structures: Vec<Structure>, label: impl Fn([usize; 3]) -> u8) -> Scene {
    let [nx, ny, _] = dims;
    let cell = |n: usize| [n % nx, n / nx % ny, n / (nx * ny)];
    let labels = Labels {
        dims,
        spacing_m: 1.5e-3,
        cells: (0..dims.iter().product()).map(|n| label(cell(n))).collect(),
        structures,
    };
    Scene::from_labels("case", &labels).expect("the case gives a valid body")
}

pub fn block(dims: [usize; 3]) -> Scene {
    body(dims, Vec::new(), |_| 1)
}

/// Makes a block whose lowest layer is fixed.
pub fn block_on_bone(dims: [usize; 3]) -> Scene {
    let mut bone = Structure::soft("bone", 2);
    bone.material.fixed = true;
    body(dims, vec![Structure::soft("tissue", 1), bone], |[_, _, k]| {
        if k == 0 { 2 } else { 1 }
    })
}
