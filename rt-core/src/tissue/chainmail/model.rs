//! What a ChainMail body is (built once) and where it is (changed by each step).

use super::spans::{Links, links_along};
use crate::scene::{Lattice, Run, Scene};
use crate::tissue::{Deformed, Limits};
use std::sync::Arc;

/// Topology and limits; never changes.
#[derive(Clone, Debug)]
pub struct ChainMail {
    pub(crate) lattice: Arc<Lattice>,
    pub(crate) limits: Limits,
    pub(crate) y_links: Links,
    pub(crate) z_links: Links,
    /// All runs along x; links along x are between neighbours in a run.
    pub(crate) runs: Vec<Run>,
    /// First and one past the last occupied row j of each plane k.
    pub(crate) rows_of_plane: Vec<[usize; 2]>,
    /// Part of the body that each element belongs to; no link joins two parts.
    pub(crate) part: Vec<u32>,
}

impl ChainMail {
    pub fn new(scene: &Scene, limits: Limits) -> Self {
        let lattice = scene.lattice.clone();
        let [_, ny, nz] = lattice.dims;
        let rows_of_plane = (0..nz).map(|k| {
            let occupied = || (0..ny).filter(|&j| !lattice.row(j, k).is_empty());
            match (occupied().next(), occupied().next_back()) {
                (Some(first), Some(last)) => [first, last + 1],
                _ => [0, 0],
            }
        });
        let rows = (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k)));
        ChainMail {
            limits,
            y_links: links_along(1, &lattice),
            z_links: links_along(2, &lattice),
            runs: rows.flat_map(|(j, k)| lattice.row(j, k)).copied().collect(),
            rows_of_plane: rows_of_plane.collect(),
            part: parts(&lattice),
            lattice,
        }
    }

    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    pub fn element_count(&self) -> usize {
        self.lattice.element_count()
    }
}

/// Numbers the connected parts of a body.
fn parts(lattice: &Lattice) -> Vec<u32> {
    const UNSEEN: u32 = u32::MAX;
    let mut part = vec![UNSEEN; lattice.element_count()];
    let mut open = Vec::new();
    let mut count = 0;
    for start in 0..part.len() as u32 {
        if part[start as usize] != UNSEEN {
            continue;
        }
        part[start as usize] = count;
        open.push(start);
        while let Some(element) = open.pop() {
            for neighbour in lattice.neighbours(element).into_iter().flatten() {
                if part[neighbour as usize] == UNSEEN {
                    part[neighbour as usize] = count;
                    open.push(neighbour);
                }
            }
        }
        count += 1;
    }
    part
}

/// Displacements from rest of all elements, in elements, one array for each axis; and scratch.
#[derive(Clone, Debug)]
pub struct TissueState {
    pub(crate) u: [Vec<f32>; 3],
    pub(crate) before: [Vec<f32>; 3],
    /// Of the last step, in elements.
    pub(crate) max_displacement: f32,
}

impl TissueState {
    /// The body at rest. Writes every page, so that no step is the first to touch one.
    pub fn at_rest(model: &ChainMail) -> Self {
        let touched = || {
            let mut component = Vec::with_capacity(model.element_count());
            component.extend((0..model.element_count()).map(|_| std::hint::black_box(0.0)));
            component
        };
        TissueState {
            u: std::array::from_fn(|_| touched()),
            before: std::array::from_fn(|_| touched()),
            max_displacement: 0.0,
        }
    }

    /// Displacement from rest along `axis` (0 to 2) of all elements, in elements.
    pub fn displacement(&self, axis: usize) -> &[f32] {
        self.u.get(axis).map_or(&[], Vec::as_slice)
    }

    /// The body as it is now.
    pub fn deformed<'a>(&'a self, model: &'a ChainMail) -> Deformed<'a> {
        let stretch = model.limits.links.iter().map(|link| link.high).sum::<f32>();
        Deformed {
            lattice: &model.lattice,
            u: self.u.each_ref().map(Vec::as_slice),
            scale: 1.0,
            reach: 1.0 + stretch + self.max_displacement,
        }
    }

    /// Centre of an element in the scene frame; the last element's for a number past the end.
    pub fn position_m(&self, model: &ChainMail, element: u32) -> [f64; 3] {
        self.deformed(model).position_m(element)
    }

    /// Every element to its place at rest, at once.
    pub fn return_to_rest(&mut self) {
        for component in &mut self.u {
            component.fill(0.0);
        }
        self.max_displacement = 0.0;
    }

    pub(crate) fn put(&mut self, element: usize, u: [f32; 3]) {
        for (component, value) in self.u.iter_mut().zip(u) {
            if let Some(slot) = component.get_mut(element) {
                *slot = value;
            }
        }
    }

    pub(crate) fn fits(&self, model: &ChainMail) -> bool {
        let n = model.element_count();
        self.u.iter().chain(&self.before).all(|c| c.len() == n)
    }
}
