//! Output of an answer: displacements of element centres, values under weights, and the force of the foundation.

use super::NodeWeight;
use super::level::BatchModel;
use super::solve::BatchState;
use crate::tissue::ElementField;
use crate::tissue::fem::real::Real;

impl<T: Real> BatchState<T> {
    /// Returns the sum of weight times displacement of answer `load`, in metres.
    pub fn sample(&self, load: usize, weights: &[NodeWeight]) -> f64 {
        let at = |entry: &NodeWeight| {
            let node = self.u.get(entry.node as usize)?;
            Some((0..3).map(|c| entry.weight[c] * node[c].0[load].to_f64()).sum::<f64>())
        };
        weights.iter().filter_map(at).sum()
    }

    /// Returns the force of the foundation on the body, N: that of the springs to rest and of the layers.
    pub fn foundation_n(&self, model: &BatchModel<T>, load: usize) -> [f64; 3] {
        let mut force = self.of_layers_n.get(load).copied().unwrap_or_default();
        for (u, &spring) in self.u.iter().zip(&model.levels[0].springs) {
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
