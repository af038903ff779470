//! Structures of a scene, each with its name and material.

use crate::limits::AxisLimits;
use serde::{Deserialize, Serialize};
pub use stylet_anatomy::{Layer, Role, Surroundings};

/// One anatomical structure; its cells carry its label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Structure {
    /// Name, as people read it.
    pub name: String,
    /// Label of its cells, 1 to 255.
    pub label: u8,
    /// Role in the procedure.
    pub role: Role,
    /// Material.
    pub material: Material,
}

/// Mechanical properties of a structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Limits of ChainMail for links along x, y, z; `None` for those that the operator has set.
    pub limits: Option<[AxisLimits; 3]>,
    /// Bone, or a probe: never moves.
    pub fixed: bool,
    /// Surroundings that it rests on at the outside of the body (FEM).
    pub surroundings: Surroundings,
    /// Young's modulus (FEM).
    pub young_pa: f64,
    /// Poisson's ratio (FEM).
    pub poisson: f64,
}

impl Structure {
    /// Makes tissue of one kind under the limits that the operator sets; modulus of the prostate: 17 kPa, Ahn 2010.
    pub fn soft(name: &str, label: u8) -> Structure {
        let material = Material {
            limits: None,
            fixed: false,
            surroundings: Surroundings::FAT,
            young_pa: 17e3,
            poisson: 0.49,
        };
        Structure {
            name: name.to_owned(),
            label,
            role: Role::Target,
            material,
        }
    }
}
