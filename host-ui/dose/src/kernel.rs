//! Dose of seeds at many points: TG-43 tabulated once over distance and angle, then four entries of
//! the table for each point.
//!
//! The table holds dose times r², which varies slowly. Nearer than 2.2 half lengths of the capsule
//! or ten of its radii, and farther than 0.15 m, the formulae themselves are used. The dose of one
//! seed at a point is rounded to 2^-30 Gy. Sums of such numbers are exact, so the order of seeds
//! does not matter and a removed seed leaves no trace.

use super::Seed;
use super::decay::Interval;
use super::source::Source;
use super::tg43::{Formalism, Tables};
use lanes::Line;
use table::Table;

mod lanes;
mod table;

/// Number of points processed together; they stay in the first cache.
pub const BLOCK: usize = 64;
/// Number of half lengths of the capsule beyond which the field times r² is nearly linear between
/// two rows.
const NEAR_HALF_LENGTHS: f64 = 2.2;

/// Dose of a seed of 1 U over an interval.
#[derive(Clone, Debug)]
pub struct DoseKernel {
    tables: Tables,
    equivalent_s: f64,
    one_d: Table,
    two_d: Table,
}

/// Seed in the frame of the points it is added to.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    line: Line,
    formalism: Formalism,
}

/// Coordinates of up to [`BLOCK`] points (m), relative to the anchor of the seeds.
pub struct Block {
    /// Coordinates along x, in m.
    pub x_m: [f32; BLOCK],
    /// Coordinates along y, in m.
    pub y_m: [f32; BLOCK],
    /// Coordinates along z, in m.
    pub z_m: [f32; BLOCK],
}

impl Block {
    /// Block whose points all lie at the origin.
    pub const ORIGIN: Self = Self {
        x_m: [0.0; BLOCK],
        y_m: [0.0; BLOCK],
        z_m: [0.0; BLOCK],
    };
}

impl DoseKernel {
    /// Returns the kernel of a source over an interval of time.
    pub fn new(source: &Source, interval: Interval) -> Self {
        let tables = source.tables.clone();
        let equivalent_s = interval.equivalent_s(source.half_life_s);
        let half_length_m = tables.capsule.half_length_m.max(tables.active_length_m / 2.0);
        let near_m = (NEAR_HALF_LENGTHS * half_length_m).max(10.0 * tables.capsule.radius_m);
        let table = |formalism| {
            Table::new(&tables, formalism, near_m, |across_m, along_m| {
                tables.rate_gy_per_s(formalism, across_m, along_m) * equivalent_s
            })
        };
        Self {
            one_d: table(Formalism::OneD),
            two_d: table(Formalism::TwoD),
            tables,
            equivalent_s,
        }
    }

    /// Computes the dose of 1 U by the formulae, for a point across and along the axis.
    pub fn exact_gy(&self, formalism: Formalism, across_m: f64, along_m: f64) -> f64 {
        self.tables.rate_gy_per_s(formalism, across_m, along_m) * self.equivalent_s
    }

    /// Computes the dose of a seed at a point by the formulae (Gy): the plain loop that is the
    /// reference for everything else.
    pub fn exact_at_gy(&self, seed: &Seed, point_m: [f64; 3]) -> f64 {
        let d = [0, 1, 2].map(|a| point_m[a] - seed.position_m[a]);
        let (formalism, axis) = match seed.axis {
            Some(axis) => (Formalism::TwoD, axis),
            None => (Formalism::OneD, [0.0, 0.0, 1.0]),
        };
        let along: f64 = d.iter().zip(axis).map(|(d, a)| d * a).sum();
        let square: f64 = d.iter().map(|d| d * d).sum();
        self.exact_gy(formalism, (square - along * along).max(0.0).sqrt(), along) * seed.strength_u
    }

    /// Returns a seed in the form of [`DoseKernel::add`], for points relative to `anchor_m`.
    pub fn place(seed: &Seed, anchor_m: [f64; 3]) -> Placed {
        Placed {
            line: Line {
                position_m: [0, 1, 2].map(|a| (seed.position_m[a] - anchor_m[a]) as f32),
                axis: seed.axis.unwrap_or([0.0, 0.0, 1.0]).map(|c| c as f32),
                strength_u: seed.strength_u as f32,
            },
            formalism: if seed.axis.is_some() {
                Formalism::TwoD
            } else {
                Formalism::OneD
            },
        }
    }

    /// Adds the dose of seeds to at most [`BLOCK`] points; `sign` is 1, or -1 to remove the seeds.
    pub fn add(&self, seeds: &[Placed], points: &Block, sign: f64, dose_gy: &mut [f64]) {
        let mut sum_gy = [0.0; BLOCK];
        let mut gy = [0.0; BLOCK];
        for seed in seeds {
            let table = self.table(seed.formalism);
            if lanes::doses(table, &seed.line, points, &mut gy) {
                self.replace_by_exact(seed, points, &mut gy);
            }
            lanes::add_rounded(&gy, &mut sum_gy);
        }
        for (dose, sum) in dose_gy.iter_mut().zip(sum_gy) {
            *dose += sign * sum;
        }
    }

    fn table(&self, formalism: Formalism) -> &Table {
        match formalism {
            Formalism::OneD => &self.one_d,
            Formalism::TwoD => &self.two_d,
        }
    }

    #[cold]
    fn replace_by_exact(&self, seed: &Placed, points: &Block, gy: &mut [f32; BLOCK]) {
        let p = seed.line.position_m;
        let [nearest, farthest] = self.table(seed.formalism).squares_m2();
        for (i, gy) in gy.iter_mut().enumerate() {
            let d = [points.x_m[i] - p[0], points.y_m[i] - p[1], points.z_m[i] - p[2]].map(f64::from);
            let square: f64 = d.iter().map(|d| d * d).sum();
            // Rounding may put a point on the other side here than in `doses`; both results are
            // valid there.
            if (nearest..farthest).contains(&square) {
                continue;
            }
            let along: f64 = d.iter().zip(seed.line.axis).map(|(d, a)| d * f64::from(a)).sum();
            let across = (square - along * along).max(0.0).sqrt();
            *gy = (self.exact_gy(seed.formalism, across, along) * f64::from(seed.line.strength_u)) as f32;
        }
    }
}
