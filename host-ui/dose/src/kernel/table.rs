//! Table of dose times r² over distance and angle.
//!
//! Columns go by the angle in even steps, rows by r² in cm². A row stands at each square whose
//! binary form ends early, at 64 or 256 of them to a doubling. The first bits of a square give its
//! row, and the others its share of the way to the next one, without a root. The squares of 0.5,
//! 0.75, 1, 1.5, 2 ... 5, 6, 7 cm, where TG-43 tables bend, are among them.

use crate::tg43::{Formalism, Tables};
use rayon::prelude::*;

pub const CM2_PER_M2: f32 = 1e4;
/// Distance beyond which the formulae are used.
const FARTHEST_M: f64 = 0.15;
const MANTISSA_BITS: u32 = 23;
/// Number of leading fraction bits that select a row; without an angle there is room for more.
const ROW_BITS: [u32; 2] = [8, 6];
/// Candidate steps of the angle; the first that divides all angles of a source's table is used.
const STEPS_DEG: [f64; 2] = [2.5, 1.0];

/// Data for the inner loops.
#[derive(Clone, Debug)]
pub struct Table {
    /// Dose of 1 U times r² (Gy m²), row by row.
    entries: Vec<f32>,
    pub columns: usize,
    pub columns_per_rad: f32,
    /// Column of half a turn, if the ends of the seed differ; otherwise columns end at a quarter.
    pub half_turn: Option<f32>,
    /// Bits of the first row's square and of the last one's (cm²).
    pub first_key: u32,
    pub last_key: u32,
    /// Number of bits of a square that are not part of its row.
    pub share_bits: u32,
}

impl Table {
    /// Creates a table from the first row beyond `near_m`; `exact_gy` gives the dose of 1 U at a
    /// point across and along the axis (m).
    pub fn new(tables: &Tables, formalism: Formalism, near_m: f64, exact_gy: impl Fn(f64, f64) -> f64 + Sync) -> Self {
        let knots_deg = tables.anisotropy_2d.as_ref().map_or(&[][..], |f| &f.columns_at);
        let [one_d_bits, two_d_bits] = ROW_BITS;
        let (step_deg, row_bits) = match formalism {
            // Two equal columns.
            Formalism::OneD => (90.0, one_d_bits),
            Formalism::TwoD => (step_deg(knots_deg), two_d_bits),
        };
        let two_ends = knots_deg.last() > Some(&90.0);
        let columns = (if two_ends { 180.0 } else { 90.0 } / step_deg) as usize + 1;
        let share_bits = MANTISSA_BITS - row_bits;
        let row_beyond = |m: f64| (((m * m) as f32 * CM2_PER_M2).to_bits() >> share_bits) + 1;
        let (first, last) = (row_beyond(near_m), row_beyond(FARTHEST_M.max(2.0 * near_m)));
        let exact_gy = &exact_gy;
        let of_row = |row: u32| {
            let r_m = square_m2(row << share_bits).sqrt();
            (0..columns).map(move |column| {
                let (across, along) = (column as f64 * step_deg).to_radians().sin_cos();
                (exact_gy(r_m * across, r_m * along) * r_m * r_m) as f32
            })
        };
        Self {
            entries: (first..=last).into_par_iter().flat_map_iter(of_row).collect(),
            columns,
            columns_per_rad: step_deg.to_radians().recip() as f32,
            half_turn: two_ends.then_some((180.0 / step_deg) as f32),
            first_key: first << share_bits,
            last_key: last << share_bits,
            share_bits,
        }
    }

    /// Returns the entries, at least two rows of at least two columns.
    pub fn entries(&self) -> &[f32] {
        &self.entries
    }

    /// Returns the squares of the distances (m²) between which the table is used.
    pub fn squares_m2(&self) -> [f64; 2] {
        [self.first_key, self.last_key].map(square_m2)
    }
}

/// Returns the square for its bits, in cm².
fn square_m2(key: u32) -> f64 {
    f64::from(f32::from_bits(key)) / f64::from(CM2_PER_M2)
}

fn step_deg(knots_deg: &[f64]) -> f64 {
    let [.., finest] = STEPS_DEG;
    let holds = |step: &f64| knots_deg.iter().all(|knot| knot % step == 0.0);
    STEPS_DEG.into_iter().find(holds).unwrap_or(finest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    #[test]
    fn tabulated_radii_and_angles_are_rows_and_columns() {
        for model in ["6711", "200"] {
            let tables = Source::known(model).expect("comes with the program").tables;
            let (f, near_m) = (tables.anisotropy_2d.as_ref().expect("has F"), 5e-3);
            let step_deg = step_deg(&f.columns_at);
            assert!(f.columns_at.iter().all(|deg| deg % step_deg == 0.0));
            let radii_m = tables.ln_radial.at.iter().chain(&f.rows_at);
            for &r_m in radii_m.filter(|r_m| (near_m..=0.07).contains(*r_m)) {
                let key = ((r_m * 100.0).powi(2) as f32).to_bits();
                for bits in ROW_BITS {
                    assert_eq!(key & ((1 << (MANTISSA_BITS - bits)) - 1), 0, "{model}: {r_m} m");
                }
            }
        }
    }

    #[test]
    fn a_source_whose_ends_differ_has_columns_for_half_a_turn() {
        let mut tables = Source::known("6711").expect("comes with the program").tables;
        let columns = |tables: &Tables| {
            let table = Table::new(tables, Formalism::TwoD, 5e-3, |_, _| 1.0);
            assert_eq!(table.entries().len() % table.columns, 0);
            (table.columns, table.half_turn)
        };
        assert_eq!(columns(&tables), (37, None));
        let at = |tables: &mut Tables, i: usize, deg| tables.anisotropy_2d.as_mut().expect("has F").columns_at[i] = deg;
        at(&mut tables, 10, 180.0);
        assert_eq!(columns(&tables), (73, Some(72.0)));
        at(&mut tables, 1, 7.0);
        assert_eq!(columns(&tables), (181, Some(180.0)));
    }
}
