//! Cubes of the layers around a body.

use crate::scene::{Lattice, Layer, Surroundings};
use crate::tissue::fem::model::FemModel;
use crate::tissue::fem::real::Real;
use std::sync::Arc;
use stylet_anatomy::Beyond;

/// Cubes for the layers, by their volume; more are made twice as large.
const MOST_CUBES: f64 = 100_000.0;
/// Cells of the body, empty cells, and fixed cells beyond the layers; numbers between are those of layers.
pub(super) const BODY: u8 = u8::MAX;
const EMPTY: u8 = u8::MAX - 1;
pub(super) const BEYOND: u8 = 0;

fn is_layer(kind: u8) -> bool {
    (1..EMPTY).contains(&kind)
}

/// Cubes around and in a body, in a box with room for the layers.
#[derive(PartialEq)]
pub(super) struct Cubes {
    pub dims: [usize; 3],
    pub edge_m: f64,
    /// Place of the lowest corner in the scene frame.
    pub low_m: [f64; 3],
    pub kinds: Vec<u8>,
    /// An element of the body in each cube of it.
    pub element: Vec<u32>,
}

impl Cubes {
    pub fn around<T: Real>(unit: &FemModel<T>, layers: &[Layer], surroundings: &[Surroundings]) -> Self {
        let lattice = unit.lattice();
        let thickness_m: f64 = layers.iter().map(|layer| layer.thickness_m).sum();
        let area_m2: f64 = unit.levels[0].springs.iter().map(|s| s.to_f64()).sum();
        let mut of_edge = 1;
        let edge_m = |n: usize| n as f64 * lattice.spacing_m;
        while area_m2 * thickness_m / edge_m(of_edge).powi(3) > MOST_CUBES {
            of_edge *= 2;
        }
        let room = (thickness_m / edge_m(of_edge)).ceil() as usize + 1;
        let [low, high] = lattice.occupied();
        let low = low.map(|c| c / of_edge);
        let dims = [0, 1, 2].map(|a| high[a].div_ceil(of_edge) - low[a] + 2 * room);
        let mut cubes = Cubes {
            dims,
            edge_m: edge_m(of_edge),
            low_m: low.map(|c| (c as f64 - room as f64) * edge_m(of_edge)),
            kinds: vec![BEYOND; dims.iter().product()],
            element: vec![u32::MAX; dims.iter().product()],
        };
        let mut filled = vec![0; cubes.kinds.len()];
        for element in 0..lattice.element_count() as u32 {
            let cell = lattice.cell(element);
            let at = cubes.index([0, 1, 2].map(|a| cell[a] / of_edge - low[a] + room));
            filled[at] += 1;
            cubes.element[at] = element;
            if 2 * filled[at] >= of_edge.pow(3) {
                cubes.kinds[at] = BODY;
            }
        }
        cubes.lay(lattice, layers, surroundings);
        cubes
    }

    /// Gives each cube outside the body its layer by the distance from the nearest cube of the body, if fat lies that
    /// way.
    fn lay(&mut self, lattice: &Lattice, layers: &[Layer], surroundings: &[Surroundings]) {
        let thickness_m: f64 = layers.iter().map(|layer| layer.thickness_m).sum();
        let reach = (thickness_m / self.edge_m).ceil() as i64 + 1;
        for (at, from) in self.nearest(reach).into_iter().enumerate() {
            let Some(from) = from.filter(|_| self.kinds[at] != BODY) else {
                continue;
            };
            let (place, nearest) = (self.place(at), self.place(from));
            let by = [0, 1, 2].map(|a| place[a] as f64 - nearest[a] as f64);
            let axis = (0..3).fold(0, |most: usize, a| if by[a].abs() > by[most].abs() { a } else { most });
            let face = 2 * axis + usize::from(by[axis] > 0.0);
            let structure = usize::from(lattice.structure(self.element[from]));
            let beyond = surroundings.get(structure).copied().unwrap_or_default().0[face];
            let distance_m = (by.iter().map(|c| c * c).sum::<f64>().sqrt() - 0.5) * self.edge_m;
            let mut left_m = distance_m;
            let layer = layers.iter().position(|layer| {
                left_m -= layer.thickness_m;
                left_m <= 0.0
            });
            self.kinds[at] = match (beyond, layer) {
                (Beyond::Free, _) => EMPTY,
                (Beyond::Fat, Some(layer)) => layer as u8 + 1,
                _ => BEYOND,
            };
        }
    }

    /// Returns the nearest cube of the body of each cube, up to so many away along each axis.
    fn nearest(&self, reach: i64) -> Vec<Option<usize>> {
        let is_body = |(at, kind): (usize, &u8)| (*kind == BODY).then_some((0, at));
        let mut nearest: Vec<Option<(i64, usize)>> = self.kinds.iter().enumerate().map(is_body).collect();
        for axis in 0..3 {
            let before = nearest.clone();
            for (at, slot) in nearest.iter_mut().enumerate() {
                let place = self.place(at);
                for by in -reach..=reach {
                    let Some(along) = place[axis].checked_add_signed(by as isize) else {
                        continue;
                    };
                    let other = [0, 1, 2].map(|a| if a == axis { along } else { place[a] });
                    let found = (along < self.dims[axis]).then(|| before[self.index(other)]).flatten();
                    let found = found.map(|(square, from)| (square + by * by, from));
                    if let Some(found) = found
                        && slot.is_none_or(|slot| found.0 < slot.0)
                    {
                        *slot = Some(found);
                    }
                }
            }
        }
        nearest.into_iter().map(|found| found.map(|(_, from)| from)).collect()
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.dims[0] * (j + self.dims[1] * k)
    }

    fn place(&self, at: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [at % nx, at / nx % ny, at / (nx * ny)]
    }

    /// Returns the cubes around a corner.
    pub fn around_corner(&self, corner: [usize; 3]) -> impl Iterator<Item = usize> + '_ {
        (0..8).filter_map(move |n| {
            let place = [0, 1, 2].map(|a| (corner[a] + (n >> a & 1)).wrapping_sub(1));
            (0..3).all(|a| place[a] < self.dims[a]).then(|| self.index(place))
        })
    }

    /// Returns whether layers do not move a corner: those of the body, and those beyond the layers.
    pub fn is_fixed(&self, corner: [usize; 3]) -> bool {
        self.around_corner(corner)
            .any(|at| [BODY, BEYOND].contains(&self.kinds[at]))
    }

    /// Returns an element of the body at a corner between it and a layer.
    pub fn body_at(&self, corner: [usize; 3]) -> Option<u32> {
        let is_in_layer = self.around_corner(corner).any(|at| is_layer(self.kinds[at]));
        let body = self.around_corner(corner).find(|&at| self.kinds[at] == BODY);
        body.filter(|_| is_in_layer).map(|at| self.element[at])
    }

    /// Returns the share of a corner in the faces between the body and a layer.
    pub fn area_m2(&self, corner: [usize; 3]) -> f64 {
        let kinds: [u8; 8] = std::array::from_fn(|n| {
            let place = [0, 1, 2].map(|a| (corner[a] + (n >> a & 1)).wrapping_sub(1));
            let is_inside = (0..3).all(|a| place[a] < self.dims[a]);
            if is_inside {
                self.kinds[self.index(place)]
            } else {
                BEYOND
            }
        });
        let is_face = |a: u8, b: u8| (a == BODY && is_layer(b)) || (b == BODY && is_layer(a));
        let of_axis = |axis: usize| (0..8).filter(move |n| n >> axis & 1 == 0);
        let faces = (0..3).map(|axis| {
            of_axis(axis)
                .filter(|n| is_face(kinds[*n], kinds[n | 1 << axis]))
                .count()
        });
        faces.sum::<usize>() as f64 * self.edge_m.powi(2) / 4.0
    }

    /// Returns the lattice of all layers, in the frame of the box.
    pub fn layers(&self) -> (Arc<Lattice>, Vec<u8>) {
        let cells: Vec<u8> = self.kinds.iter().map(|&kind| u8::from(is_layer(kind))).collect();
        let structures = self.kinds.iter().filter(|&&kind| is_layer(kind)).map(|kind| kind - 1);
        let lattice = Lattice::of_cells(self.dims, self.edge_m, &cells);
        (Arc::new(lattice), structures.collect())
    }
}
