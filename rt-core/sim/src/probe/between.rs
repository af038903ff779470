//! Displacement of the wall's points by forces on points, through loads on the pads alone: `B = S C^-1 S'`.
//!
//! `S` is how points move with a newton on each pad, `C` how pads do. A force on a point is put on the pads as `C^-1
//! S'` says: of all loads on pads these move the points to where the force wants them with the least work. The points
//! then move by exactly `B` in the body, wherever they lie between pads, and the work at points is that at pads.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Addition to the diagonal, over the mean of that of `C`: pads share elements of a coarse body, and columns are solved
/// to a residual of 1 %.
const RIDGE: f64 = 1e-4;
const MOST_RIDGE: f64 = 1.0;

/// Shares and compliance of points.
pub(super) struct PointCompliance {
    /// Loads of the pads' rows by a newton on each row of the points: one row of the points after another.
    pub shares: Vec<f32>,
    /// Displacement of all points along x, y, z by a newton on each point along x, y, z, m/N: one row of so many after
    /// another.
    pub rows: Vec<f32>,
}

impl PointCompliance {
    /// Computes `B`; `answers` is `S`, `compliance` `C`, both row after row of so many columns.
    pub fn of(answers: &[f64], compliance: &[f64], rows: usize) -> Self {
        let points = answers.len() / rows.max(1) / 3;
        let answers = DMatrix::from_row_slice(3 * points, rows, answers);
        let factor = factor_of(&DMatrix::from_row_slice(rows, rows, compliance));
        let half = factor.l().solve_lower_triangular(&answers.transpose());
        let half = half.unwrap_or_else(|| DMatrix::zeros(rows, 3 * points));
        let all = half.tr_mul(&half);
        let shares = factor.solve(&answers.transpose());
        PointCompliance {
            // Column after column of `C^-1 S'`.
            shares: shares.iter().map(|share| *share as f32).collect(),
            // Symmetric: columns are rows.
            rows: all.iter().map(|moved| *moved as f32).collect(),
        }
    }
}

fn factor_of(compliance: &DMatrix<f64>) -> Cholesky<f64, Dyn> {
    let size = compliance.nrows();
    let mean = compliance.diagonal().mean();
    let mut ridge = RIDGE;
    loop {
        let stiffer = compliance + DMatrix::identity(size, size) * (ridge * mean);
        if let Some(factor) = Cholesky::new(stiffer) {
            return factor;
        }
        if ridge >= MOST_RIDGE {
            return Cholesky::new_unchecked(DMatrix::identity(size, size) * mean);
        }
        ridge *= 10.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_on_a_pad_moves_as_that_and_one_between_two_loads_both() {
        // Two pads that share nothing, a point on each and one half way.
        let rows = 6;
        let own = |n: usize| if n < 3 { 1e-3 } else { 2e-3 };
        let compliance: Vec<f64> = (0..36)
            .map(|n| if n / rows == n % rows { own(n / rows) } else { 0.0 })
            .collect();
        let mut answers = compliance.clone();
        answers.extend((0..18).map(|n| {
            if (n % rows) % 3 == n / rows {
                0.5 * own(n % rows)
            } else {
                0.0
            }
        }));
        let between = PointCompliance::of(&answers, &compliance, rows);
        let along_y = |a: usize, b: usize| f64::from(between.rows[(3 * a + 1) * 9 + 3 * b + 1]);
        for (found, wanted) in [
            (along_y(0, 0), 1e-3),
            (along_y(1, 1), 2e-3),
            (along_y(0, 1), 0.0),
            (along_y(0, 2), 0.5e-3),
            (along_y(2, 2), 0.75e-3),
        ] {
            assert!((found - wanted).abs() < 3e-4 * 1e-3, "{found} {wanted}");
        }
        let shares = &between.shares[6 * rows..7 * rows];
        for (n, share) in shares.iter().enumerate() {
            let wanted = if n % 3 == 0 { 0.5 } else { 0.0 };
            assert!((share - wanted).abs() < 1e-3, "{n}: {share}");
        }
    }
}
