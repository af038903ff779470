//! Tables as TG-43 prints them, with interpolation and extrapolation.

/// Values over rising arguments.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Arguments, rising.
    pub at: Vec<f64>,
    /// Values at these arguments.
    pub values: Vec<f64>,
}

impl Curve {
    /// Interpolates linearly between the entries; holds the end values beyond them.
    pub fn held(&self, x: f64) -> f64 {
        let (i, share) = place(&self.at, x);
        self.blend(i, share.clamp(0.0, 1.0))
    }

    /// Interpolates linearly between the entries. Holds the first value before them, and continues
    /// the line through the last two after them.
    pub fn extended(&self, x: f64) -> f64 {
        let (i, share) = place(&self.at, x);
        self.blend(i, share.max(0.0))
    }

    fn blend(&self, i: usize, share: f64) -> f64 {
        match self.values.get(i + 1) {
            Some(next) => self.values[i] + share * (next - self.values[i]),
            None => self.values[i],
        }
    }
}

/// A table over two rising arguments, rows by the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Arguments of the rows, rising.
    pub rows_at: Vec<f64>,
    /// Arguments of the columns, rising.
    pub columns_at: Vec<f64>,
    /// Values, row by row.
    pub values: Vec<f64>,
}

impl Table {
    /// Interpolates bilinearly inside; holds the edge beyond.
    pub fn held(&self, row: f64, column: f64) -> f64 {
        let (i, down) = place(&self.rows_at, row);
        let (j, along) = place(&self.columns_at, column);
        let (down, along) = (down.clamp(0.0, 1.0), along.clamp(0.0, 1.0));
        let columns = self.columns_at.len();
        let (i1, j1) = ((i + 1).min(self.rows_at.len() - 1), (j + 1).min(columns - 1));
        let at = |i: usize, j: usize| self.values[i * columns + j];
        let upper = at(i, j) + along * (at(i, j1) - at(i, j));
        let lower = at(i1, j) + along * (at(i1, j1) - at(i1, j));
        upper + down * (lower - upper)
    }
}

/// Returns the interval of `x`, and the position in it; below 0 or above 1 outside the table.
fn place(at: &[f64], x: f64) -> (usize, f64) {
    if at.len() < 2 {
        return (0, 0.0);
    }
    let i = at.partition_point(|&a| a <= x).clamp(1, at.len() - 1) - 1;
    (i, (x - at[i]) / (at[i + 1] - at[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_linear_inside_and_held_or_extended_outside() {
        let curve = Curve {
            at: vec![1.0, 2.0, 4.0],
            values: vec![10.0, 20.0, 0.0],
        };
        assert_eq!(curve.held(1.5), 15.0);
        assert_eq!(curve.held(2.0), 20.0);
        assert_eq!((curve.held(0.0), curve.held(9.0)), (10.0, 0.0));
        assert_eq!((curve.extended(0.0), curve.extended(5.0)), (10.0, -10.0));
    }

    #[test]
    fn a_table_is_bilinear_inside_and_held_outside() {
        let table = Table {
            rows_at: vec![0.0, 1.0],
            columns_at: vec![0.0, 10.0],
            values: vec![1.0, 2.0, 3.0, 8.0],
        };
        assert_eq!(table.held(0.5, 5.0), 3.5);
        assert_eq!(table.held(9.0, -4.0), 3.0);
    }
}
