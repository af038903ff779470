//! What a structure is in the procedure, and how it yields.

use super::Surroundings;
use serde::{Deserialize, Serialize};

/// What a structure is in the procedure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// Seeds are planned in it.
    Target,
    /// To be kept from needles and dose.
    Spare,
    /// Neither.
    #[default]
    Tissue,
}

/// How a structure yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus, in Pa.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// For links along x, y, z: shortest and longest as a share of the rest length, and shear in rad; `None`: the operator's limits.
    pub limits: Option<[[f64; 3]; 3]>,
    /// The structure never moves.
    pub fixed: bool,
    /// What it rests on where it is at the outside of the body.
    pub surroundings: Surroundings,
}

impl Material {
    const fn soft(young_pa: f64) -> Self {
        Self {
            young_pa,
            poisson: 0.49,
            limits: None,
            fixed: false,
            surroundings: Surroundings::FAT,
        }
    }

    /// Prostate, 17 kPa: Ahn 2010.
    pub const GLAND: Self = Self::soft(17e3);
    /// Assumed, as in the built-in pelvis: muscle.
    pub const URETHRA: Self = Self::soft(30e3);
    /// Wall of rectum or bladder. Assumed, as in the built-in pelvis: muscle, relaxed.
    pub const WALL: Self = Self::soft(20e3);
    /// Every other tissue. Assumed, as in the built-in pelvis: skin and muscle together.
    pub const OTHER: Self = Self::soft(15e3);
    /// Apparent modulus of cancellous bone: 0.1 to 0.5 GPa, Goldstein 1987. Fixed, since the table holds the pelvis.
    pub const BONE: Self = Self {
        young_pa: 300e6,
        poisson: 0.3,
        limits: None,
        fixed: true,
        surroundings: Surroundings::FAT,
    };
}
