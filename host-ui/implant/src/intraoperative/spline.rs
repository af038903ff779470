//! A smooth function of an angle through a few values: a periodic cubic spline.

use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Difference below which two angles are one, rad.
const SAME_RAD: f64 = 0.02;

/// Function with continuous second derivative all around.
#[derive(Clone, Debug)]
pub struct Periodic {
    /// Angles, rising, within one turn, rad.
    angles: Vec<f64>,
    values: Vec<f64>,
    /// Second derivatives at the angles.
    bends: Vec<f64>,
}

impl Periodic {
    /// Interpolates these values at their angles, in any order; values at one angle are averaged.
    /// `None` for fewer than three angles.
    pub fn through(mut points: Vec<(f64, f64)>) -> Option<Self> {
        points.iter_mut().for_each(|(angle, _)| *angle = angle.rem_euclid(TAU));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut groups: Vec<(f64, Vec<f64>)> = Vec::new();
        for (angle, value) in points {
            match groups.last_mut() {
                Some((last, values)) if angle - *last < SAME_RAD => values.push(value),
                _ => groups.push((angle, vec![value])),
            }
        }
        let mean = |values: &Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
        let angles: Vec<f64> = groups.iter().map(|(angle, _)| *angle).collect();
        let values: Vec<f64> = groups.iter().map(|(_, values)| mean(values)).collect();
        let count = angles.len();
        if count < 3 {
            return None;
        }
        let mut spline = Self {
            angles,
            values,
            bends: vec![0.0; count],
        };
        let (mut system, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for n in 0..count {
            let before = (n + count - 1) % count;
            let ([left, own], next) = ([before, n].map(|n| spline.span(n)), (n + 1) % count);
            system[(n, before)] += left;
            system[(n, n)] += 2.0 * (left + own);
            system[(n, next)] += own;
            let slope = |from: usize, to: usize, span: f64| (spline.values[to] - spline.values[from]) / span;
            right[n] = 6.0 * (slope(n, next, own) - slope(before, n, left));
        }
        spline.bends = system.lu().solve(&right)?.iter().copied().collect();
        Some(spline)
    }

    /// Returns the span from an angle to the next one.
    fn span(&self, n: usize) -> f64 {
        match self.angles.get(n + 1) {
            Some(next) => next - self.angles[n],
            None => self.angles[0] + TAU - self.angles[n],
        }
    }

    /// Returns the largest distance between neighbouring angles, rad.
    pub fn widest_gap(&self) -> f64 {
        (0..self.angles.len()).map(|n| self.span(n)).fold(0.0, f64::max)
    }

    /// Returns the value at an angle.
    pub fn at(&self, angle: f64) -> f64 {
        let past = (angle - self.angles[0]).rem_euclid(TAU);
        let count = self.angles.len();
        let after = self.angles.partition_point(|a| a - self.angles[0] <= past);
        let (n, next) = (after - 1, after % count);
        let span = self.span(n);
        let t = past - (self.angles[n] - self.angles[0]);
        let s = span - t;
        let (from, to) = (self.bends[n], self.bends[next]);
        from * s.powi(3) / (6.0 * span)
            + to * t.powi(3) / (6.0 * span)
            + (self.values[n] / span - from * span / 6.0) * s
            + (self.values[next] / span - to * span / 6.0) * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the closed-form error of the spline of a cosine, in the middle between equal
    /// angles h apart.
    #[test]
    fn the_error_of_a_cosine_matches_the_closed_form() {
        let h = TAU / 6.0;
        let spline = Periodic::through((0..6).map(|n| (f64::from(n) * h, (f64::from(n) * h).cos())).collect());
        let spline = spline.expect("six angles");
        // The second derivatives are minus the cosine times this.
        let bend = 6.0 / (h * h) * (2.0 - 2.0 * h.cos()) / (4.0 + 2.0 * h.cos());
        let middle = (h / 2.0).cos() * (1.0 + h * h / 8.0 * bend);
        for n in 0..6 {
            let angle = f64::from(n) * h;
            assert!((spline.at(angle) - angle.cos()).abs() < 1e-12, "through its values");
            let at = angle + h / 2.0 - 3.0 * TAU;
            assert!((spline.at(at) - middle * at.cos()).abs() < 1e-12);
        }
        assert!((spline.widest_gap() - h).abs() < 1e-12);
    }

    #[test]
    fn values_at_one_angle_are_averaged() {
        let spline = Periodic::through(vec![(3.0, 1.0), (1.0, 2.0), (5.0, 3.0), (-TAU + 1.001, 4.0)]);
        assert!((spline.expect("three angles").at(1.0) - 3.0).abs() < 1e-12);
        assert!(Periodic::through(vec![(0.0, 1.0), (1.0, 2.0), (TAU, 3.0)]).is_none());
    }
}
