//! Layers around the body as forces that follow from a load: no answer needs to be known.
//!
//! With `A` the body on its springs and `U D U^T` the stiffness that the layers have beyond these, the answer to a load
//! `b` is that of `A` to `b - U y`, where `y = (1 + D U^T W)^-1 D W^T b` and `W = A^-1 U` (Woodbury).

use super::{LOADS, NodeWeight};
use crate::tissue::fem::real::Real;
use nalgebra::{DMatrix, DVector};

/// Layers around one part of the body.
#[derive(Clone, Debug)]
pub(super) struct Support<T> {
    /// Nodes on the surface.
    pub nodes: Vec<u32>,
    /// Columns of U on these nodes.
    pub forces: Vec<Vec<[T; 3]>>,
    /// Columns of W on all nodes.
    pub answers: Vec<Vec<[T; 3]>>,
    /// `(1 + D U^T W)^-1 D`.
    pub mix: DMatrix<f64>,
}

impl<T: Real> Support<T> {
    /// Calls `add` with each node of the surface and the force on it, and returns their sum.
    pub fn react(&self, load: &[NodeWeight], mut add: impl FnMut(u32, [f64; 3])) -> [f64; 3] {
        let along = |answer: &Vec<[T; 3]>| {
            let at = |entry: &NodeWeight| {
                let node = answer.get(entry.node as usize)?;
                Some((0..3).map(|c| entry.weight[c] * node[c].to_f64()).sum::<f64>())
            };
            load.iter().filter_map(at).sum::<f64>()
        };
        let shares = &self.mix * DVector::from_iterator(self.answers.len(), self.answers.iter().map(along));
        let mut sum = [0.0; 3];
        for (n, &node) in self.nodes.iter().enumerate() {
            let mut force = [0.0; 3];
            for (column, share) in self.forces.iter().zip(&shares) {
                (0..3).for_each(|c| force[c] -= share * column[n][c].to_f64());
            }
            (0..3).for_each(|c| sum[c] += force[c]);
            add(node, force);
        }
        sum
    }

    /// Returns its size in bytes.
    pub fn bytes(&self) -> usize {
        let fields = self.forces.iter().chain(&self.answers);
        fields.map(|field| field.len() * size_of::<[T; 3]>()).sum()
    }
}

/// Force of the layers on the body for each load.
pub(super) type OfLayers = [[f64; 3]; LOADS];
