//! Materials of structures, and the stiffness of one hexahedron.

use crate::scene::Surroundings;

/// Integration of the volumetric part of an element's energy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integration {
    /// 2 x 2 x 2 Gauss points for everything, as textbooks do; locks as nu comes near 0.5.
    Full,
    /// The element's mean dilatation carries all of the volumetric energy (B-bar, Hughes 1980); does not lock.
    MeanDilatation,
}

/// Isotropic and linear elastic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus, Pa.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio, up to [`MAX_POISSON_RATIO`].
    pub poisson_ratio: f64,
    /// Integration of the volumetric energy.
    pub integration: Integration,
}

impl Material {
    /// Prostate: 17 kPa (Ahn 2010), and close enough to incompressible that more changes little.
    pub const PROSTATE: Material = Material {
        youngs_modulus_pa: 17e3,
        poisson_ratio: 0.49,
        integration: Integration::MeanDilatation,
    };

    pub(super) fn lame_pa(&self) -> (f64, f64) {
        let (e, nu) = (self.youngs_modulus_pa, self.poisson_ratio);
        (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)))
    }
}

/// Mechanical behaviour of a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Structure {
    /// Tissue.
    Elastic(Material),
    /// Bone, a probe: its nodes do not move.
    Fixed,
}

/// Settings that a model is made from, besides the lattice.
#[derive(Clone, Debug, PartialEq)]
pub struct FemSettings {
    /// Structures, at least one.
    pub structures: Vec<Structure>,
    /// Structure of each element; empty if there is one structure only.
    pub structure_of: Vec<u8>,
    /// Springs to rest that stand for the fat around the body: stiffness per surface area.
    pub foundation_pa_per_m: f64,
    /// Surroundings that each structure rests on at the outside; empty: fat on all sides.
    pub surroundings: Vec<Surroundings>,
}

impl FemSettings {
    /// Returns the settings of one material, in surroundings of the given stiffness.
    pub fn homogeneous(material: Material, foundation_pa_per_m: f64) -> Self {
        FemSettings {
            structures: vec![Structure::Elastic(material)],
            structure_of: Vec::new(),
            foundation_pa_per_m,
            surroundings: Vec::new(),
        }
    }
}

/// Largest Poisson ratio; multigrid needs ever more cycles towards 0.5.
pub const MAX_POISSON_RATIO: f64 = 0.499;

/// Why settings make no model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FemProblem {
    /// Nothing to be made of.
    #[error("0 structures, at least 1 needed")]
    NoStructures,
    /// A modulus that no tissue has.
    #[error("Young's modulus {youngs_modulus_pa} Pa of structure {structure}, must be from 1 Pa to 1e12 Pa")]
    Modulus {
        /// Its place in the list.
        structure: usize,
        /// Its modulus, Pa.
        youngs_modulus_pa: f64,
    },
    /// A Poisson ratio beyond what the solver takes.
    #[error("Poisson ratio {poisson_ratio} of structure {structure}, must be from 0 to {MAX_POISSON_RATIO}")]
    PoissonRatio {
        /// Its place in the list.
        structure: usize,
        /// Its ratio.
        poisson_ratio: f64,
    },
    /// A foundation that no surroundings have.
    #[error("stiffness of the surroundings {foundation_pa_per_m} Pa/m, must be from 0 to 1e15 Pa/m")]
    Foundation {
        /// Stiffness per surface area, Pa/m.
        foundation_pa_per_m: f64,
    },
    /// Not one structure for each element.
    #[error("{given} structure numbers for {elements} elements: give one for each element, or none")]
    StructureCount {
        /// Elements of the lattice.
        elements: usize,
        /// Numbers given.
        given: usize,
    },
    /// A number beyond the list.
    #[error("element {element} is of structure {structure}, which is not given")]
    UnknownStructure {
        /// The first such element.
        element: usize,
        /// Its structure.
        structure: u8,
    },
}

/// Returns every problem; of elements with an unknown structure, the first.
pub(super) fn problems_of(settings: &FemSettings, elements: usize) -> Vec<FemProblem> {
    let mut problems = Vec::new();
    if settings.structures.is_empty() {
        problems.push(FemProblem::NoStructures);
    }
    for (structure, material) in settings.structures.iter().enumerate() {
        let Structure::Elastic(material) = *material else {
            continue;
        };
        if !(1.0..=1e12).contains(&material.youngs_modulus_pa) {
            problems.push(FemProblem::Modulus {
                structure,
                youngs_modulus_pa: material.youngs_modulus_pa,
            });
        }
        if !(0.0..=MAX_POISSON_RATIO).contains(&material.poisson_ratio) {
            problems.push(FemProblem::PoissonRatio {
                structure,
                poisson_ratio: material.poisson_ratio,
            });
        }
    }
    if !(0.0..=1e15).contains(&settings.foundation_pa_per_m) {
        problems.push(FemProblem::Foundation {
            foundation_pa_per_m: settings.foundation_pa_per_m,
        });
    }
    let given = settings.structure_of.len();
    if given != 0 && given != elements {
        problems.push(FemProblem::StructureCount { elements, given });
    }
    let known = |&structure: &u8| usize::from(structure) < settings.structures.len();
    if let Some(element) = settings.structure_of.iter().position(|s| !known(s)) {
        problems.push(FemProblem::UnknownStructure {
            element,
            structure: settings.structure_of[element],
        });
    }
    problems
}
