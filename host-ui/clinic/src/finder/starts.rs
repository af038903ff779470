//! Initial places of a component's seeds, and exchanges of seeds.

use super::components::{Component, place_m};
use super::shape::Line;
use super::split::{Fitter, Task};
use nalgebra::Vector3;

/// Number of times that each seed of a component may be moved to where signal remains.
const EXCHANGES: usize = 2;
/// Factor by which an exchange must lower the sum of squares.
const WORTHWHILE: f64 = 0.99;
impl Fitter<'_> {
    /// Places the seeds of a component one after the other where most signal remains, or by
    /// k-means, whichever fits better.
    pub fn starts(&self, task: &Task, component: &Component, count: usize) -> Vec<Line> {
        if count < 2 {
            return (0..count).map(|_| self.new_line(component.middle_m)).collect();
        }
        let mut by_remainder: Vec<Line> = Vec::new();
        while by_remainder.len() < count {
            let mut left = task.data.clone();
            by_remainder
                .iter()
                .for_each(|line| task.patch.add(line, &self.look, -1.0, &mut left));
            by_remainder.push(self.new_line(self.brightest(component, &left)));
            self.improve(task, &mut by_remainder);
        }
        let mut by_means = self.means(component, &task.data, count);
        let [one, other] = [&mut by_remainder, &mut by_means].map(|lines| self.improve(task, lines));
        if one <= other { by_remainder } else { by_means }
    }

    /// Returns the place of most signal, summed over the voxels within a seed's reach.
    fn brightest(&self, component: &Component, left: &[f64]) -> Vector3<f64> {
        let places: Vec<Vector3<f64>> = component.voxels.iter().map(|n| place_m(self.volume, *n)).collect();
        // A voxel is thicker than a seed, so its centre may lie outside the seed.
        let across_m = self.look.blur_m.hypot(self.look.diameter_m) + self.volume.frame.spacing_m[0] / 2.0;
        let is_near = |p: &Vector3<f64>, middle: &Vector3<f64>| {
            let off = p - middle;
            let along = off.dot(&self.axes[0]);
            along.abs() <= self.look.length_m / 2.0 + across_m && (off - self.axes[0] * along).norm() <= across_m
        };
        let within = |middle: &Vector3<f64>| {
            let near = places.iter().zip(left).filter(|(p, _)| is_near(p, middle));
            near.map(|(_, value)| value).sum::<f64>()
        };
        let best = places.iter().max_by(|a, b| within(a).total_cmp(&within(b)));
        let middle = best.copied().unwrap_or(component.middle_m);
        let near = places.iter().zip(left).filter(|(p, _)| is_near(p, &middle));
        let (sum, moment) = near.fold((0.0, Vector3::zeros()), |(sum, moment), (p, value)| {
            (sum + value.max(0.0), moment + p * value.max(0.0))
        });
        if sum > 0.0 { moment / sum } else { middle }
    }

    /// Returns the k-means of the weighted voxels, from places far from each other.
    fn means(&self, component: &Component, data: &[f64], count: usize) -> Vec<Line> {
        let places: Vec<Vector3<f64>> = component.voxels.iter().map(|n| place_m(self.volume, *n)).collect();
        let weights: Vec<f64> = data.iter().map(|v| v.max(0.0)).collect();
        let mut middles = vec![self.brightest(component, data)];
        let nearest = |middles: &[Vector3<f64>], p: &Vector3<f64>| {
            let distances = middles.iter().map(|m| (m - p).norm_squared()).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
        };
        while middles.len() < count {
            let far = |n: &usize| weights[*n] * nearest(&middles, &places[*n]).1;
            let next = (0..places.len()).max_by(|a, b| far(a).total_cmp(&far(b)));
            middles.push(next.map_or(component.middle_m, |n| places[n]));
        }
        for _ in 0..20 {
            let mut sums = vec![(0.0, Vector3::zeros()); count];
            for (place, weight) in places.iter().zip(&weights) {
                let (n, _) = nearest(&middles, place);
                sums[n].0 += weight;
                sums[n].1 += place * *weight;
            }
            for (middle, (weight, moment)) in middles.iter_mut().zip(sums) {
                if weight > 0.0 {
                    *middle = moment / weight;
                }
            }
        }
        middles.into_iter().map(|middle_m| self.new_line(middle_m)).collect()
    }

    /// Removes each seed in turn and puts it where most signal remains, while the fit improves.
    pub fn exchange(&self, task: &Task, component: &Component, lines: &mut Vec<Line>) {
        if lines.len() < 2 {
            return;
        }
        let mut cost = self.residuals(task, lines).norm_squared();
        let count = lines.len();
        for n in (0..EXCHANGES).flat_map(|_| 0..count) {
            let mut other = lines.clone();
            other.remove(n);
            self.improve(task, &mut other);
            let mut left = task.data.clone();
            other
                .iter()
                .for_each(|line| task.patch.add(line, &self.look, -1.0, &mut left));
            other.insert(n, self.new_line(self.brightest(component, &left)));
            let after = self.improve(task, &mut other);
            if after < WORTHWHILE * cost {
                (cost, *lines) = (after, other);
            }
        }
    }

    fn new_line(&self, middle_m: Vector3<f64>) -> Line {
        Line {
            middle_m,
            axis: self.axes[0],
            amount: 1.0,
        }
    }
}
