//! The layers that a needle goes through: each with its own membrane, cutting force and shaft friction.

use crate::scene::{Role, Structure};
use crate::settings::{Problem, Problems};
use serde::{Deserialize, Serialize};
use stylet_anatomy::Organ;

/// Kind of layer. The numbers are stable: they index [`Layers`] and appear between the loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[repr(u32)]
pub enum LayerKind {
    /// Prostate, in its capsule.
    #[default]
    Gland = 0,
    /// Skin and perineum.
    Perineum = 1,
    /// Fat and other tissue without a membrane.
    Surroundings = 2,
    /// Wall of a hollow organ: urethra, bladder, rectum.
    Wall = 3,
}

impl LayerKind {
    /// Returns the kind of layer of a structure: by its role, and skin by its name.
    pub fn of_structure(structure: &Structure) -> LayerKind {
        let is_skin = [Organ::Skin, Organ::Perineum]
            .iter()
            .any(|organ| organ.is_mentioned_in(&structure.name));
        match structure.role {
            Role::Target => Self::Gland,
            Role::Spare => Self::Wall,
            Role::Tissue if is_skin => Self::Perineum,
            Role::Tissue => Self::Surroundings,
        }
    }
}

/// Kinds of tissue.
pub const LAYER_COUNT: usize = 4;

/// One kind of tissue, as the needle feels it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Layer {
    /// `u_cri` of its membrane; 0 for tissue without one.
    pub puncture_depth_m: f64,
    /// Height of `F_R` (eq. 10): what the membrane resists with when it gives way.
    pub puncture_force_n: f64,
    /// Resistance at the tip while it cuts, by eq. 9; not on a line.
    pub cutting_force_n: f64,
    /// Work that it takes to separate an area of the tissue, J/m²: cutting on a line.
    pub toughness_j_per_m2: f64,
    /// `K_f` of eq. 9: friction for each metre of shaft in this layer.
    pub shaft_friction_n_per_m: f64,
}

impl Layer {
    /// Default layers in order of [`LayerKind`]; sources in `docs/physics.md`.
    pub const DEFAULTS: [Layer; LAYER_COUNT] = [
        Layer {
            puncture_depth_m: 8e-3,
            puncture_force_n: 5.6,
            cutting_force_n: 1.5,
            toughness_j_per_m2: 164.0,
            shaft_friction_n_per_m: 80.0,
        },
        Layer {
            puncture_depth_m: 12e-3,
            puncture_force_n: 9.0,
            cutting_force_n: 1.0,
            toughness_j_per_m2: 200.0,
            shaft_friction_n_per_m: 40.0,
        },
        Layer {
            puncture_depth_m: 0.0,
            puncture_force_n: 0.0,
            cutting_force_n: 0.3,
            toughness_j_per_m2: 50.0,
            shaft_friction_n_per_m: 15.0,
        },
        Layer {
            puncture_depth_m: 4e-3,
            puncture_force_n: 2.0,
            cutting_force_n: 0.8,
            toughness_j_per_m2: 200.0,
            shaft_friction_n_per_m: 40.0,
        },
    ];

    /// Returns whether there is a membrane to puncture.
    pub fn has_membrane(&self) -> bool {
        self.puncture_depth_m > 0.0
    }
}

/// Every kind, in order of [`LayerKind`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Layers(pub [Layer; LAYER_COUNT]);

impl Default for Layers {
    fn default() -> Self {
        Self(Layer::DEFAULTS)
    }
}

/// Key of each limit, so that a problem names its layer.
const KEYS: [[&str; 5]; LAYER_COUNT] = [
    [
        "gland.puncture_depth_m",
        "gland.puncture_force_n",
        "gland.cutting_force_n",
        "gland.shaft_friction_n_per_m",
        "gland.toughness_j_per_m2",
    ],
    [
        "perineum.puncture_depth_m",
        "perineum.puncture_force_n",
        "perineum.cutting_force_n",
        "perineum.shaft_friction_n_per_m",
        "perineum.toughness_j_per_m2",
    ],
    [
        "surroundings.puncture_depth_m",
        "surroundings.puncture_force_n",
        "surroundings.cutting_force_n",
        "surroundings.shaft_friction_n_per_m",
        "surroundings.toughness_j_per_m2",
    ],
    [
        "wall.puncture_depth_m",
        "wall.puncture_force_n",
        "wall.cutting_force_n",
        "wall.shaft_friction_n_per_m",
        "wall.toughness_j_per_m2",
    ],
];

impl Layers {
    /// Returns the layer of one kind.
    pub fn of(&self, kind: LayerKind) -> Layer {
        self.0.get(kind as usize).copied().unwrap_or(Layer::DEFAULTS[0])
    }

    /// Returns every setting that cannot be used, or `Ok`.
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        for (layer, keys) in self.0.iter().zip(KEYS) {
            problems.range(keys[0], layer.puncture_depth_m, 0.0, 0.05);
            problems.range(keys[1], layer.puncture_force_n, 0.0, 30.0);
            problems.range(keys[2], layer.cutting_force_n, 0.0, 20.0);
            problems.range(keys[3], layer.shaft_friction_n_per_m, 0.0, 1e3);
            problems.range(keys[4], layer.toughness_j_per_m2, 0.0, 1e4);
        }
        problems.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_every_problem_names_its_layer() {
        assert_eq!(Layers::default().validate(), Ok(()));
        let mut broken = Layers::default();
        broken.0[1].puncture_force_n = f64::NAN;
        broken.0[3].shaft_friction_n_per_m = -1.0;
        let keys: Vec<_> = broken.validate().unwrap_err().iter().map(|p| p.key).collect();
        assert_eq!(keys, ["perineum.puncture_force_n", "wall.shaft_friction_n_per_m"]);
    }
}
