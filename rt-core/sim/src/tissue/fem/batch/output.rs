//! Output of an answer: displacements of element centres, values under weights, and the force of the foundation.

use super::level::{BatchModel, NodeWeight, Part};
use super::solve::{BatchState, finest};
use crate::tissue::ElementField;
use crate::tissue::fem::model::FemModel;
use crate::tissue::fem::real::Real;

impl<T: Real> BatchModel<T> {
    /// Returns the part of the body that a node belongs to.
    pub fn part_of(&self, node: u32) -> Option<&Part> {
        let part = *self.part_of_node.get(node as usize)?;
        self.parts.get(part as usize)
    }

    pub(super) fn find_parts(&mut self, model: &FemModel<T>) {
        let level = &self.levels[0];
        let numbers = model.part.iter().filter(|&&part| part != u32::MAX).max();
        let count = numbers.map_or(0, |&last| last as usize + 1);
        let (mut springs_n_per_m, mut is_held) = (vec![0.0; count], vec![false; count]);
        self.part_of_node = vec![u32::MAX; level.node_count];
        let used = level
            .node_at
            .iter()
            .zip(&model.part)
            .filter(|(node, _)| **node != u32::MAX);
        for (&node, &part) in used {
            let (node, number) = (node as usize, part as usize);
            self.part_of_node[node] = part;
            springs_n_per_m[number] += level.springs[node].to_f64();
            is_held[number] |= level.inverse_diagonal[node] == T::ZERO;
        }
        self.parts = vec![Part::default(); count];
        for run in &model.runs {
            let elements = &mut self.parts[model.part[run.cell] as usize].elements;
            let (first, end) = (run.first as u32, (run.first + run.len) as u32);
            match elements.last_mut() {
                Some(last) if last.end == first => last.end = end,
                _ => elements.push(first..end),
            }
        }
        for (part, (springs_n_per_m, is_held)) in self.parts.iter_mut().zip(springs_n_per_m.into_iter().zip(is_held)) {
            if !is_held && springs_n_per_m > 0.0 {
                part.m_per_n = 1.0 / springs_n_per_m;
            }
        }
    }
}

impl<T: Real> BatchState<T> {
    /// Returns the sum of weight times displacement of answer `load`, in metres.
    pub fn sample(&self, load: usize, weights: &[NodeWeight]) -> f64 {
        let at = |entry: &NodeWeight| {
            let node = self.u.get(entry.node as usize)?;
            Some((0..3).map(|c| entry.weight[c] * node[c].0[load].to_f64()).sum::<f64>())
        };
        weights.iter().filter_map(at).sum()
    }

    /// Returns the force of the foundation on the body, N: that of the springs to rest.
    pub fn foundation_n(&self, model: &BatchModel<T>, load: usize) -> [f64; 3] {
        let mut force = [0.0; 3];
        for (u, &spring) in self.u.iter().zip(&finest(model).springs) {
            for c in 0..3 {
                force[c] -= spring.to_f64() * u[c].0[load].to_f64();
            }
        }
        force
    }

    /// Writes answer `load` to `field`: the mean of its eight corners is the displacement of an element's centre.
    pub fn write(&self, model: &BatchModel<T>, load: usize, field: &mut ElementField) {
        let [x, y, z] = &mut field.0;
        // Elements of a run share the face between them.
        let (mut face, mut sum) = ([u32::MAX; 4], [T::ZERO; 3]);
        for ((lines, x), (y, z)) in model.corners.iter().zip(x).zip(y.iter_mut().zip(z)) {
            let near = if *lines == face { sum } else { self.over(load, lines) };
            face = lines.map(|at| at.saturating_add(1));
            sum = self.over(load, &face);
            let mean = [0, 1, 2].map(|c| (0.125 * (near[c] + sum[c]).to_f64()) as f32);
            [*x, *y, *z] = mean;
        }
    }

    /// Sums over four nodes.
    #[inline(always)]
    fn over(&self, load: usize, nodes: &[u32; 4]) -> [T; 3] {
        let node = |at: u32, c: usize| self.u.get(at as usize).map_or(T::ZERO, |u| u[c].0[load]);
        let [a, b, c, d] = *nodes;
        [0, 1, 2].map(|n| (node(a, n) + node(b, n)) + (node(c, n) + node(d, n)))
    }
}
