//! The surface between a body and its layers, and its displacements.

use super::cubes::Cubes;
use super::on_body::OnBody;
use crate::scene::Layer;
use crate::tissue::fem::batch::{HeldForces, condensed, held_forces};
use crate::tissue::fem::material::{FemProblem, FemSettings, Integration, Material, Structure};
use crate::tissue::fem::model::FemModel;
use crate::tissue::fem::real::Real;
use nalgebra::DMatrix;
use stylet_settings::ProblemList;

/// Poisson's ratio of every layer, as of the other soft tissue (assumed).
const POISSON: f64 = 0.49;
/// Surface over that of the largest part from which on a part of a body has its own displacements.
const LEAST_SURFACE: f64 = 0.05;

/// Corners of cubes between the body and its layers.
#[derive(PartialEq)]
pub(super) struct Surface {
    corners: Vec<[usize; 3]>,
    places_m: Vec<[f64; 3]>,
    area_m2: Vec<f64>,
    /// Parts that are large enough.
    pub parts: Vec<PartOfSurface>,
}

#[derive(PartialEq)]
pub(super) struct PartOfSurface {
    number: u32,
    /// Number of the corner in the surface.
    corners: Vec<usize>,
    pub area_m2: f64,
    /// Something fixed holds it.
    pub is_held: bool,
    middle_m: [f64; 3],
    scale_m: f64,
    /// Polynomials by coefficient, orthonormal over the surface; the first is constant. Each is one along x, y and z.
    pub shapes: Vec<[f64; TERMS]>,
}

const TERMS: usize = 10;

fn terms([x, y, z]: [f64; 3]) -> [f64; TERMS] {
    [1.0, x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]
}

impl Surface {
    pub fn of<T: Real>(unit: &FemModel<T>, cubes: &Cubes) -> Self {
        let mut surface = Surface {
            corners: Vec::new(),
            places_m: Vec::new(),
            area_m2: Vec::new(),
            parts: Vec::new(),
        };
        let mut number = Vec::new();
        let size = cubes.dims.map(|n| n + 1);
        for at in 0..size.iter().product() {
            let corner = [at % size[0], at / size[0] % size[1], at / (size[0] * size[1])];
            if let Some(element) = cubes.body_at(corner) {
                number.push(unit.part_of_element(element));
                surface.corners.push(corner);
                surface
                    .places_m
                    .push([0, 1, 2].map(|a| cubes.low_m[a] + corner[a] as f64 * cubes.edge_m));
                surface.area_m2.push(cubes.area_m2(corner));
            }
        }
        let count = number.iter().max().map_or(0, |&last| last + 1);
        let area_of = |part: u32| number.iter().zip(&surface.area_m2).filter(move |(of, _)| **of == part);
        let areas_m2: Vec<f64> = (0..count)
            .map(|part| area_of(part).map(|(_, area)| area).sum())
            .collect();
        let largest_m2 = areas_m2.iter().copied().fold(0.0, f64::max);
        for (part, _) in (0..count)
            .zip(&areas_m2)
            .filter(|(_, area)| **area > LEAST_SURFACE * largest_m2)
        {
            let corners = (0..number.len()).filter(|&n| number[n] == part).collect();
            let part = PartOfSurface::new(&surface, part, corners, unit.is_fixed_somewhere(part));
            surface.parts.push(part);
        }
        surface
    }

    /// Returns the force on each corner that holds each shape of each part.
    pub fn forces<T: Real>(&self, cubes: &Cubes, layers: &[Layer]) -> Result<HeldForces, ProblemList<FemProblem>> {
        let (lattice, structure_of) = cubes.layers();
        let material = |layer: &Layer| {
            Structure::Elastic(Material {
                youngs_modulus_pa: layer.young_pa,
                poisson_ratio: POISSON,
                integration: Integration::MeanDilatation,
            })
        };
        let settings = FemSettings {
            structures: layers.iter().map(material).collect(),
            structure_of,
            foundation_pa_per_m: 0.0,
            surroundings: Vec::new(),
        };
        let corner_of = |place_m: [f64; 3]| place_m.map(|c| (c / cubes.edge_m).round() as usize);
        let is_fixed = |place_m: [f64; 3]| cubes.is_fixed(corner_of(place_m));
        let model = FemModel::<T>::of_lattice(&lattice, &lattice, &settings, &is_fixed)?;
        let grid = &model.levels[0].grid;
        let node = |corner: &[usize; 3]| grid.index([0, 1, 2].map(|a| corner[a] - model.low_cell[a])) as u32;
        let held: Vec<u32> = self.corners.iter().map(node).collect();
        let mut displacements_m = Vec::new();
        for part in &self.parts {
            for shape in 0..3 * part.shapes.len() {
                let mut by_m = vec![[0.0; 3]; held.len()];
                for &n in &part.corners {
                    by_m[n][shape % 3] = part.at(shape / 3, self.places_m[n]);
                }
                displacements_m.push(by_m);
            }
        }
        Ok(held_forces(&condensed(&model), &held, &displacements_m))
    }
}

impl PartOfSurface {
    fn new(surface: &Surface, number: u32, corners: Vec<usize>, is_held: bool) -> Self {
        let area_m2 = corners.iter().map(|&n| surface.area_m2[n]).sum::<f64>();
        let mean = |value: &dyn Fn([f64; 3]) -> f64| {
            let at = |&n: &usize| surface.area_m2[n] * value(surface.places_m[n]);
            corners.iter().map(at).sum::<f64>() / area_m2
        };
        let middle_m = [0, 1, 2].map(|a| mean(&|place_m| place_m[a]));
        let square = |place_m: [f64; 3]| (0..3).map(|a| (place_m[a] - middle_m[a]).powi(2)).sum::<f64>();
        let mut part = PartOfSurface {
            number,
            area_m2,
            is_held,
            middle_m,
            scale_m: mean(&square).sqrt(),
            shapes: Vec::new(),
            corners,
        };
        // What is held as a whole has its springs alone, whose stiffness is that against translation.
        for term in 0..if is_held { 1 } else { TERMS } {
            let mut shape = [0.0; TERMS];
            shape[term] = 1.0;
            let first = part.product(surface, &shape, &shape);
            for _ in 0..2 {
                for other in part.shapes.clone() {
                    let along = part.product(surface, &shape, &other);
                    (0..TERMS).for_each(|t| shape[t] -= along * other[t]);
                }
            }
            let left = part.product(surface, &shape, &shape);
            if left > 1e-6 * first {
                part.shapes.push(shape.map(|c| c / left.sqrt()));
            }
        }
        part
    }

    fn product(&self, surface: &Surface, a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
        let at = |&n: &usize| {
            let terms = self.terms(surface.places_m[n]);
            surface.area_m2[n] * value(a, &terms) * value(b, &terms)
        };
        self.corners.iter().map(at).sum()
    }

    fn terms(&self, place_m: [f64; 3]) -> [f64; TERMS] {
        terms([0, 1, 2].map(|a| (place_m[a] - self.middle_m[a]) / self.scale_m))
    }

    /// Returns the value of a shape at a place.
    fn at(&self, shape: usize, place_m: [f64; 3]) -> f64 {
        value(&self.shapes[shape], &self.terms(place_m))
    }

    /// Transfers the forces from the corners of cubes to the nodes of the body.
    pub fn on_body<T: Real>(
        &self,
        unit: &FemModel<T>,
        surface: &Surface,
        forces: &[Vec<[f64; 3]>],
        stiffness: &DMatrix<f64>,
    ) -> OnBody {
        let level = &unit.levels[0];
        let is_own = |node: &usize| unit.part[*node] == self.number && level.springs[*node].to_f64() > 0.0;
        let nodes: Vec<usize> = (0..level.grid.len()).filter(is_own).collect();
        let spacing_m = unit.lattice().spacing_m;
        let loaded: Vec<usize> = self
            .corners
            .iter()
            .copied()
            .filter(|&n| surface.area_m2[n] > 0.0)
            .collect();
        let mut on_body = OnBody {
            part: self.number,
            area_m2: nodes.iter().map(|&node| level.springs[node].to_f64()).collect(),
            shapes: Vec::new(),
            forces: vec![Vec::with_capacity(nodes.len()); forces.len()],
            nodes: nodes.iter().map(|&node| node as u32).collect(),
        };
        for (&node, &area_m2) in nodes.iter().zip(&on_body.area_m2) {
            let place = level.grid.place(node);
            let place_m = [0, 1, 2].map(|a| (place[a] + unit.low_cell[a]) as f64 * spacing_m);
            let square = |n: &usize| {
                (0..3)
                    .map(|a| (surface.places_m[*n][a] - place_m[a]).powi(2))
                    .sum::<f64>()
            };
            let nearest = loaded.iter().copied().min_by(|a, b| square(a).total_cmp(&square(b)));
            for (on_nodes, of_shape) in on_body.forces.iter_mut().zip(forces) {
                let traction = nearest.map_or([0.0; 3], |n| of_shape[n].map(|f| f / surface.area_m2[n]));
                on_nodes.push(traction.map(|t| t * area_m2));
            }
            on_body
                .shapes
                .push((0..self.shapes.len()).map(|n| self.at(n, place_m)).collect());
        }
        on_body.agree_with(stiffness);
        on_body
    }
}

fn value(shape: &[f64; TERMS], terms: &[f64; TERMS]) -> f64 {
    shape.iter().zip(terms).map(|(c, t)| c * t).sum()
}
