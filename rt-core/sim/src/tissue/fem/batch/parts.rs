//! Parts of a body that share no node: each moves as one piece on its own springs.

use super::level::{BatchModel, NO_NODE, Part};
use crate::tissue::fem::model::{FemModel, NO_PART};
use crate::tissue::fem::real::Real;

impl<T: Real> BatchModel<T> {
    /// Returns the part of the body that a node belongs to.
    pub fn part_of(&self, node: u32) -> Option<&Part> {
        let part = *self.part_of_node.get(node as usize)?;
        self.parts.get(part as usize)
    }

    pub(super) fn find_parts(&mut self, model: &FemModel<T>) {
        let level = &self.levels[0];
        let numbers = model.part.iter().filter(|&&part| part != NO_PART).max();
        let count = numbers.map_or(0, |&last| last as usize + 1);
        let (mut springs_n_per_m, mut is_held) = (vec![0.0; count], vec![false; count]);
        self.part_of_node = vec![NO_PART; level.node_count];
        let used = level
            .node_at
            .iter()
            .zip(&model.part)
            .filter(|(node, _)| **node != NO_NODE);
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
        for reaction in &model.reactions {
            if let Some(part) = self.parts.get_mut(reaction.part as usize) {
                part.m_per_n = reaction.whole_m_per_n;
            }
        }
    }
}
