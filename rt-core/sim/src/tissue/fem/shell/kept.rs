//! Forces of layers that were solved before. They depend on the shape of the body and on the layers, but not on the
//! materials of the body: the bodies of a study, of rehearsals and of a changed stiffness share them.

#![allow(
    clippy::disallowed_types,
    reason = "a lock is held where a body is made, which no loop does"
)]

use super::cubes::Cubes;
use super::surface::Surface;
use crate::scene::Layer;
use crate::tissue::fem::batch::HeldForces;
use crate::tissue::fem::material::FemProblem;
use crate::tissue::fem::real::Real;
use std::sync::{Arc, Mutex, PoisonError};
use stylet_settings::ProblemList;

/// A scene has at most two bodies: its own and that of its lines.
const MOST: usize = 4;

static KEPT: Mutex<Kept> = Mutex::new(Kept(Vec::new()));

/// Layers that were solved, the newest last.
pub(super) struct Kept(Vec<Arc<Solved>>);

/// Layers around a body, solved.
pub(super) struct Solved {
    cubes: Cubes,
    layers: Vec<Layer>,
    bytes_of_number: usize,
    pub surface: Surface,
    pub forces: HeldForces,
}

/// Solves the layers, or returns what was solved for the same ones. Another thread waits meanwhile.
pub(super) fn solved<T: Real>(
    cubes: Cubes,
    surface: Surface,
    layers: &[Layer],
) -> Result<Arc<Solved>, ProblemList<FemProblem>> {
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    kept.solved::<T>(cubes, surface, layers)
}

impl Kept {
    fn solved<T: Real>(
        &mut self,
        cubes: Cubes,
        surface: Surface,
        layers: &[Layer],
    ) -> Result<Arc<Solved>, ProblemList<FemProblem>> {
        let is_same = |one: &&Arc<Solved>| {
            let is_same_number = one.bytes_of_number == size_of::<T>();
            is_same_number && one.layers == layers && one.cubes == cubes && one.surface == surface
        };
        if let Some(same) = self.0.iter().find(is_same) {
            return Ok(same.clone());
        }
        let solved = Arc::new(Solved {
            forces: surface.forces::<T>(&cubes, layers)?,
            cubes,
            layers: layers.to_vec(),
            bytes_of_number: size_of::<T>(),
            surface,
        });
        if self.0.len() == MOST {
            self.0.remove(0);
        }
        self.0.push(solved.clone());
        Ok(solved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Lattice;
    use crate::tissue::fem::material::{FemSettings, Material};
    use crate::tissue::fem::model::FemModel;

    #[test]
    fn layers_are_solved_anew_for_other_layers_or_another_shape_alone() {
        let fat = Layer {
            thickness_m: 6e-3,
            young_pa: 5e3,
        };
        let mut kept = Kept(Vec::new());
        let mut solved = |wide: usize, young_pa: f64, layers: &[Layer]| {
            let lattice = Arc::new(Lattice::of_cells([wide, 5, 5], 2e-3, &vec![1; wide * 25]));
            let gland = Material {
                youngs_modulus_pa: young_pa,
                ..Material::PROSTATE
            };
            let settings = FemSettings::homogeneous(gland, 1.0);
            let unit = FemModel::<f32>::of_lattice(&lattice, &lattice, &settings, &|_| false).expect("valid");
            let cubes = Cubes::around(&unit, layers, &[]);
            let surface = Surface::of(&unit, &cubes);
            kept.solved::<f32>(cubes, surface, layers).expect("valid")
        };
        let first = solved(6, 17e3, &[fat]);
        assert!(Arc::ptr_eq(&first, &solved(6, 34e3, &[fat])));
        assert!(!Arc::ptr_eq(&first, &solved(7, 17e3, &[fat])));
        let stiffer = Layer { young_pa: 6e3, ..fat };
        assert!(!Arc::ptr_eq(&first, &solved(6, 17e3, &[stiffer])));
        assert!(Arc::ptr_eq(&first, &solved(6, 17e3, &[fat])));
    }
}
