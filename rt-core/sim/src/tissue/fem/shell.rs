//! Layers of soft tissue around a body, whose outside does not move: their stiffness on the body's surface.
//!
//! The layers are solved alone, in cubes, with the body's surface held in each displacement that is a polynomial of
//! second degree in place. Parts of a body have their own polynomials, and do not feel each other through the layers.

mod cubes;
mod kept;
mod on_body;
mod surface;

use super::material::{FemProblem, FemSettings};
use super::model::FemModel;
use super::real::Real;
use crate::scene::{Lattice, Layer};
use cubes::Cubes;
use std::sync::Arc;
use stylet_settings::ProblemList;
use surface::{PartOfSurface, Surface};

impl<T: Real> FemModel<T> {
    /// Makes the body of `lattice` in the elements of `of`, in layers where there are any: then its springs are as
    /// stiff as these against translation, the mean over all directions.
    pub(super) fn of_layered(
        lattice: &Lattice,
        of: &Arc<Lattice>,
        settings: &FemSettings,
        layers: &[Layer],
    ) -> Result<Self, ProblemList<FemProblem>> {
        let on_springs = |foundation_pa_per_m: f64| {
            let settings = FemSettings {
                foundation_pa_per_m,
                ..settings.clone()
            };
            FemModel::of_lattice(lattice, of, &settings, &|_| false)
        };
        if layers.is_empty() {
            return on_springs(settings.foundation_pa_per_m);
        }
        let unit = on_springs(1.0)?;
        let cubes = Cubes::around(&unit, layers, &settings.surroundings);
        let surface = Surface::of(&unit, &cubes);
        let area_m2: f64 = surface.parts.iter().map(|part| part.area_m2).sum();
        if area_m2 == 0.0 {
            // A body too thin for the cubes.
            let m_per_pa: f64 = layers.iter().map(|layer| layer.thickness_m / layer.young_pa).sum();
            return on_springs(1.0 / m_per_pa.max(1e-12));
        }
        let solved = kept::solved::<T>(cubes, surface, layers)?;
        let (surface, held) = (&solved.surface, &solved.forces);
        let mut first = 0;
        let mut springs_pa_per_m = 0.0;
        let mut parts = Vec::new();
        for part in &surface.parts {
            let count = 3 * part.shapes.len();
            let forces = &held.forces_n[first..first + count];
            let stiffness = held.work_j.view((first, first), (count, count)).into_owned();
            first += count;
            // The first three shapes are translations by one over the root of the area.
            let translation = part.area_m2 * stiffness.view((0, 0), (3, 3));
            springs_pa_per_m += translation.trace() / (3.0 * area_m2);
            parts.push((part, forces, stiffness, translation));
        }
        let reaction = |(part, forces, stiffness, translation): (&PartOfSurface, _, _, nalgebra::DMatrix<f64>)| {
            let whole_m_per_n = translation.try_inverse()?.trace() / 3.0;
            let on_body = part.on_body(&unit, surface, forces, &stiffness);
            on_body.beyond_springs(springs_pa_per_m, stiffness, whole_m_per_n)
        };
        let mut model = on_springs(springs_pa_per_m)?;
        let loose = parts.into_iter().filter(|(part, ..)| !part.is_held);
        model.reactions = loose.filter_map(reaction).collect();
        Ok(model)
    }
}

#[cfg(test)]
mod tests;
