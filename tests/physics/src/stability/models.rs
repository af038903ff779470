//! The tissue models under test, and their bodies.

use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::{Labels, Scene, Structure};
use stylet_sim::tissue::{ChainMailTissue, FemTissue, TissueModel};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    ChainMail,
    Fem,
}

impl Kind {
    pub const ALL: [Kind; 2] = [Kind::ChainMail, Kind::Fem];

    pub fn name(self) -> &'static str {
        match self {
            Kind::ChainMail => "ChainMail",
            Kind::Fem => "FEM",
        }
    }

    pub fn on(self, scene: &Scene, parameters: &TissueParameters) -> Box<dyn TissueModel> {
        match self {
            Kind::Fem => {
                let mut fem = FemTissue::<f32>::new(scene).expect("the case gives valid materials");
                // The solver's capability, not its time in the loop.
                fem.settings.max_cycles = 40;
                Box::new(fem)
            }
            Kind::ChainMail => {
                let limits = parameters.validate().expect("the case gives valid settings");
                Box::new(ChainMailTissue::new(scene, limits))
            }
        }
    }
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
