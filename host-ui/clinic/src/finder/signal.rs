//! Signal of a component once its seeds, its neighbours and the tissue around it are known.

use super::components::Component;
use super::counts::median;
use super::shape::{Line, Patch};
use super::split::Fitter;

/// Contribution of seeds, in standard deviations of the noise, below which voxels are dim; and the
/// number of dim voxels that show the tissue.
const DIM: f64 = 0.5;
const FEWEST_DIM: usize = 20;

impl Fitter<'_> {
    /// Returns the signal of each component without its neighbours' seeds; `field` is that of all
    /// seeds.
    ///
    /// Adds the signal of its own seeds and their residuals in the bright voxels: in the many
    /// others uneven tissue would add up. It is at least that of the bright voxels.
    pub fn signals(&self, components: &[Component], lines: &[Vec<Line>], field: &[f64], tissue: &[f64]) -> Vec<f64> {
        let bright = self.level.threshold - self.level.tissue;
        let of_component = |((component, lines), tissue): ((&Component, &Vec<Line>), &f64)| {
            let own = self.of_lines(component, lines);
            let of_seeds: f64 = lines.iter().map(|line| line.amount * self.look.signal).sum();
            let voxels = component.voxels.iter().zip(&component.excess).zip(&own);
            let left = voxels.map(|((n, excess), own)| (excess, excess - tissue - (field[*n] - own) - own));
            let counted = left.filter(|(excess, _)| lines.is_empty() || **excess >= bright);
            (of_seeds + counted.map(|(_, left)| left).sum::<f64>()).max(component.core)
        };
        components.iter().zip(lines).zip(tissue).map(of_component).collect()
    }

    /// Returns the value of the tissue around a component above that of the volume. It is the
    /// median of what its dim voxels have beyond the seeds so far; without seeds, or with few dim
    /// voxels, that of the voxels around it.
    pub fn tissue_near(&self, component: &Component, lines: &[Line], others: &[f64]) -> f64 {
        if lines.is_empty() {
            return component.tissue;
        }
        let own = self.of_lines(component, lines);
        let voxels = component.voxels.iter().zip(&component.excess).zip(&own);
        let dim = voxels.filter(|((n, _), own)| **own + others[**n] < DIM * self.level.noise);
        let left: Vec<f64> = dim.map(|((n, excess), own)| excess - own - others[*n]).collect();
        if left.len() < FEWEST_DIM {
            return component.tissue;
        }
        median(left)
    }

    /// Returns the contribution of seeds to each voxel of a component.
    fn of_lines(&self, component: &Component, lines: &[Line]) -> Vec<f64> {
        let patch = Patch::of(self.volume.dims, self.volume.frame.spacing_m, &component.voxels);
        let mut own = vec![0.0; component.voxels.len()];
        lines.iter().for_each(|line| patch.add(line, &self.look, 1.0, &mut own));
        own
    }
}
