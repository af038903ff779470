//! Role of a structure in the procedure, and its stiffness.

use super::Surroundings;
use serde::{Deserialize, Serialize};

/// Role of a structure in the procedure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// Seeds are planned in the structure.
    Target,
    /// To be kept from needles and dose.
    Spare,
    /// Neither.
    #[default]
    Tissue,
}

/// Mechanical properties of a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus, in Pa.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// For links along x, y, z: shortest and longest as a fraction of the rest length, and shear in rad; `None`: the
    /// operator's limits.
    pub limits: Option<[[f64; 3]; 3]>,
    /// The structure never moves.
    pub fixed: bool,
    /// Support of its outer faces.
    pub surroundings: Surroundings,
}

impl Material {
    /// Largest Poisson's ratio that the solvers take: 0.5 would need an extra unknown, the pressure.
    pub const MAX_POISSON: f64 = 0.499;

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
    /// Apparent modulus of cancellous bone: 0.1 to 0.5 GPa, Goldstein 1987. Fixed, since the table supports the pelvis.
    pub const BONE: Self = Self {
        young_pa: 300e6,
        poisson: 0.3,
        limits: None,
        fixed: true,
        surroundings: Surroundings::FAT,
    };
}
