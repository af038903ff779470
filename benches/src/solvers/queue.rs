//! First moved, first processed: the textbook's propagation.

use super::body::{Body, ordered, outer_end};
use stylet_sim::scene::Lattice;

/// No neighbour.
const NONE: u32 = u32::MAX;

/// Neighbour table and queue, allocated once.
pub struct PlainQueue {
    /// Neighbours at -x, +x, -y, +y, -z, +z.
    neighbours: Vec<[u32; 6]>,
    /// Elements in the order in which they moved; each enters at most once.
    queue: Vec<u32>,
    has_moved: Vec<bool>,
}

impl PlainQueue {
    /// Makes a queue for bodies of this lattice.
    pub fn new(lattice: &Lattice) -> Self {
        let count = lattice.element_count();
        let around = |element: u32| lattice.neighbours(element).map(|n| n.unwrap_or(NONE));
        PlainQueue {
            neighbours: (0..count as u32).map(around).collect(),
            queue: Vec::with_capacity(count),
            has_moved: vec![false; count],
        }
    }

    /// Puts `held` in place, `at` elements from rest, and moves the others outward from it; returns how many moved.
    ///
    /// An element moves once, with the first neighbour that violates a limit with it.
    pub fn run(&mut self, body: &mut Body, held: u32, at: [f32; 3]) -> u32 {
        body.put(held, at);
        self.has_moved.fill(false);
        self.has_moved[held as usize] = true;
        self.queue.clear();
        self.queue.push(held);
        let mut next = 0;
        while let Some(&inner) = self.queue.get(next) {
            next += 1;
            let around = self.neighbours[inner as usize];
            for axis in 0..3 {
                self.push::<false>(body, axis, inner, around[2 * axis]);
                self.push::<true>(body, axis, inner, around[2 * axis + 1]);
            }
        }
        self.queue.len() as u32
    }

    /// Moves `outer` into the limits of its link with `inner`, unless it has moved.
    #[inline(always)]
    fn push<const UP: bool>(&mut self, body: &mut Body, axis: usize, inner: u32, outer: u32) {
        if outer == NONE || self.has_moved[outer as usize] {
            return;
        }
        let [a, b, c] = ordered(axis, body.u.each_mut().map(Vec::as_mut_slice));
        let at = |e: u32| [a[e as usize], b[e as usize], c[e as usize]];
        let (new, moved) = outer_end::<UP>(&body.limits[axis], at(inner), at(outer));
        if moved {
            let e = outer as usize;
            (a[e], b[e], c[e]) = (new[0], new[1], new[2]);
            self.has_moved[e] = true;
            self.queue.push(outer);
        }
    }
}
