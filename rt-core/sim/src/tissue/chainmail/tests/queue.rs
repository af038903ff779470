//! The textbook's propagation, first moved first processed: one pass, which leaves violations behind.

use std::collections::VecDeque;

use crate::tissue::chainmail::kernels::{self, LOWER, Scaled, UPPER, ordered};
use crate::tissue::chainmail::{ChainMail, Held, TissueState};

/// Neighbour table and scratch, allocated once.
pub struct QueuePass {
    neighbours: Vec<[Option<u32>; 6]>,
    queue: VecDeque<u32>,
    visited: Vec<bool>,
}

impl QueuePass {
    pub fn new(model: &ChainMail) -> Self {
        let elements = 0..model.element_count() as u32;
        QueuePass {
            neighbours: elements.map(|e| model.lattice.neighbours(e)).collect(),
            queue: VecDeque::with_capacity(model.element_count()),
            visited: vec![false; model.element_count()],
        }
    }

    /// Puts the held element in place and moves others outward from it; returns how many moved.
    ///
    /// An element is moved once, by the first neighbour that violates a limit with it.
    ///
    /// # Panics
    ///
    /// If there is no such element, the state is of another model, or the body has several structures.
    pub fn run(&mut self, model: &ChainMail, state: &mut TissueState, held: Held) -> u32 {
        let rest = model.lattice.rest_m(held.element);
        let u = [0, 1, 2].map(|a| (held.position_m[a] - rest[a]) / model.lattice.spacing_m);
        state.put(held.element as usize, u.map(|c| c as f32));
        assert_eq!(model.classes.count(), 1, "the textbook knows one kind of tissue");
        let rest = 1.0 / state.scale();
        let limits = [0, 1, 2].map(|axis| model.classes.limits(0, axis).scaled(rest, 0.0));
        state.disturb(model);
        self.visited.fill(false);
        self.visited[held.element as usize] = true;
        self.queue.push_back(held.element);
        let mut moved = 1;
        while let Some(inner) = self.queue.pop_front() {
            for (direction, neighbour) in self.neighbours[inner as usize].into_iter().enumerate() {
                let Some(outer) = neighbour else { continue };
                if !self.visited[outer as usize] && push(&limits, state, direction, inner, outer) {
                    self.visited[outer as usize] = true;
                    self.queue.push_back(outer);
                    moved += 1;
                }
            }
        }
        moved
    }
}

/// Moves `outer` into the limits of its link with `inner`; whether it had to move.
fn push(limits: &[Scaled; 3], state: &mut TissueState, direction: usize, inner: u32, outer: u32) -> bool {
    let axis = direction / 2;
    let limits = &limits[axis];
    let at = |e: u32| ordered(axis, state.u.each_ref().map(|c| c[e as usize]));
    let (from, old) = (at(inner), at(outer));
    let (new, moved) = if direction % 2 == 1 {
        kernels::clamped_outer::<UPPER>(limits, from, old)
    } else {
        kernels::clamped_outer::<LOWER>(limits, from, old)
    };
    if moved {
        for (component, value) in ordered(axis, state.u.each_mut()).into_iter().zip(new) {
            component[outer as usize] = value;
        }
    }
    moved
}
