//! Stiffness of layers on the nodes of a body.

use crate::tissue::fem::reaction::Reaction;
use nalgebra::DMatrix;

/// The layers' forces on the nodes of a part.
pub(super) struct OnBody {
    pub part: u32,
    pub nodes: Vec<u32>,
    pub area_m2: Vec<f64>,
    /// Value of each shape at each node.
    pub shapes: Vec<Vec<f64>>,
    /// Force on each node for each shape along x, y, z.
    pub forces: Vec<Vec<[f64; 3]>>,
}

impl OnBody {
    /// Returns the sum over nodes of two shapes and the area.
    fn products(&self) -> DMatrix<f64> {
        let count = self.forces.len() / 3;
        DMatrix::from_fn(count, count, |m, n| {
            let nodes = self.shapes.iter().zip(&self.area_m2);
            nodes.map(|(shapes, area)| area * shapes[m] * shapes[n]).sum()
        })
    }

    /// Adds tractions that are shapes themselves, so that the forces do the work of the stiffness.
    pub fn agree_with(&mut self, stiffness: &DMatrix<f64>) {
        let Some(inverse) = self.products().try_inverse() else {
            return;
        };
        for (n, forces) in self.forces.iter_mut().enumerate() {
            let mut missing: Vec<f64> = (0..stiffness.nrows()).map(|m| stiffness[(m, n)]).collect();
            for (shapes, force) in self.shapes.iter().zip(forces.iter()) {
                for (m, missing) in missing.iter_mut().enumerate() {
                    *missing -= shapes[m / 3] * force[m % 3];
                }
            }
            for ((shapes, area), force) in self.shapes.iter().zip(&self.area_m2).zip(forces) {
                for (m, missing) in missing.iter().enumerate() {
                    let traction: f64 = shapes.iter().enumerate().map(|(s, v)| v * inverse[(s, m / 3)]).sum();
                    force[m % 3] += area * traction * missing;
                }
            }
        }
    }

    /// Makes the stiffness in which the springs' own against each shape is replaced by the layers'.
    pub fn beyond_springs(
        mut self,
        springs_pa_per_m: f64,
        stiffness: DMatrix<f64>,
        whole_m_per_n: f64,
    ) -> Option<Reaction> {
        let size = self.forces.len();
        let of_springs = (self.products() * springs_pa_per_m).try_inverse()?;
        let of_layers = stiffness.try_inverse()?;
        for shape in 0..size {
            let nodes = self.shapes.iter().zip(&self.area_m2);
            let force = |(shapes, area): (&Vec<f64>, &f64)| {
                let mut force = [0.0; 3];
                force[shape % 3] = springs_pa_per_m * area * shapes[shape / 3];
                force
            };
            self.forces.push(nodes.map(force).collect());
        }
        let mix = DMatrix::from_fn(2 * size, 2 * size, |m, n| match (m < size, n < size) {
            (true, true) => of_layers[(m, n)],
            (false, false) if m % 3 == n % 3 => -of_springs[((m - size) / 3, (n - size) / 3)],
            _ => 0.0,
        });
        Some(Reaction {
            part: self.part,
            nodes: self.nodes,
            forces: self.forces,
            mix,
            whole_m_per_n,
        })
    }
}
