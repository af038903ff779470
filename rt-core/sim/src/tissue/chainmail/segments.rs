//! Segments: consecutive elements whose neighbours are consecutive too, or missing for all of them alike.

use super::classes::Classes;
use super::spans::Rows;
use crate::scene::{Lattice, Scene};

/// No neighbour before the first element, or after the last.
pub(super) const LEFT: u8 = 1;
pub(super) const RIGHT: u8 = 2;

/// Elements that relax alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub first: u32,
    pub len: u32,
    /// Neighbours of the first element at -y, +y, -z, +z; itself where there is none.
    pub beside: [u32; 4],
    /// `LEFT`, `RIGHT`, both or neither.
    pub open: u8,
    /// Place in the table of weights.
    weights: u32,
}

/// Segments of every row. Fixed elements are in none.
#[derive(Clone, Debug)]
pub(crate) struct Segments {
    all: Vec<Segment>,
    /// First segment of each row, with one more entry at the end.
    first: Vec<u32>,
    /// Stiffness of the links to the six neighbours relative to that of the first structure; empty if all is one
    /// structure.
    weights: Vec<[f32; 6]>,
}

impl Segments {
    pub fn of(scene: &Scene, rows: &Rows, classes: &Classes) -> Segments {
        let lattice = &*scene.lattice;
        let mut segments = Segments {
            all: Vec::new(),
            first: Vec::new(),
            weights: Vec::new(),
        };
        let several = scene.structures.len() > 1;
        for row in 0..rows.count() {
            segments.first.push(segments.all.len() as u32);
            for run in rows.numbers(row) {
                let run = rows.runs[run];
                let free = (run.first..run.end()).filter(|&e| !classes.is_fixed(lattice.structure(e)));
                for element in free {
                    segments.push(lattice, several.then_some(scene), element);
                }
            }
        }
        segments.first.push(segments.all.len() as u32);
        segments.all.shrink_to_fit();
        segments
    }

    pub fn bytes(&self) -> usize {
        size_of::<Segment>() * self.all.capacity()
            + size_of::<u32>() * self.first.capacity()
            + size_of::<[f32; 6]>() * self.weights.capacity()
    }

    #[inline(always)]
    pub(super) fn of_row(&self, row: usize) -> &[Segment] {
        &self.all[self.first[row] as usize..self.first[row + 1] as usize]
    }

    #[inline(always)]
    pub(super) fn weights(&self, segment: &Segment) -> Option<&[f32; 6]> {
        self.weights.get(segment.weights as usize)
    }

    /// Adds an element, to the last segment if it continues alike.
    fn push(&mut self, lattice: &Lattice, several: Option<&Scene>, element: u32) {
        let around = lattice.neighbours(element);
        let weights = several.map(|scene| link_weights(scene, element, &around));
        let beside = [2, 3, 4, 5].map(|n| around[n].unwrap_or(element));
        let open = LEFT * u8::from(around[0].is_none()) + RIGHT * u8::from(around[1].is_none());
        if let Some(last) = self.all.last_mut()
            && open & LEFT == 0
            && last.first + last.len == element
            && last.open & RIGHT == 0
            && (0..4).all(|n| beside[n] == last.beside[n] + last.len)
            && weights.is_none_or(|w| self.weights[last.weights as usize] == w)
        {
            last.len += 1;
            last.open |= open;
            return;
        }
        self.all.push(Segment {
            first: element,
            len: 1,
            beside,
            open,
            weights: self.weights.len() as u32,
        });
        self.weights.extend(weights);
    }
}

/// Returns the harmonic means of the moduli at both ends of each link, as of springs in series; a fixed end is no
/// spring.
fn link_weights(scene: &Scene, element: u32, around: &[Option<u32>; 6]) -> [f32; 6] {
    let material = |e: u32| &scene.structures[scene.lattice.structure(e) as usize].material;
    let own = material(element).young_pa;
    let reference = scene.structures.iter().find(|s| !s.material.fixed);
    let reference = reference.map_or(own, |s| s.material.young_pa);
    around.map(|neighbour| match neighbour {
        None => 0.0,
        Some(n) if material(n).fixed => (own / reference) as f32,
        Some(n) => {
            let other = material(n).young_pa;
            (2.0 * own * other / (own + other) / reference) as f32
        }
    })
}
