//! Displacement of each station by a force at each, `W = B K^-1 B^T`, with what a lattice cannot resolve of a thin
//! needle.

use super::columns::Column;
use super::near::NearTip;
use super::rows::Rows;
use super::stations::Stations;
use crate::tissue::fem::Compiled;
use crate::tissue::fem::batch::BatchModel;
use serde::{Deserialize, Serialize};

/// Shortest end of a shaft that loads a station, over the station's length. The shorter, the more a result depends on
/// the hand's steps, and the less is left of the tip's own compliance where the shaft sticks (ADR 26).
const SHORTEST: f64 = 0.5;

/// Stations that were all solved for: symmetric, positive definite. Rows 0 to m - 1 are the shaft's stations, m to 2m -
/// 1 the tip's patch at the same places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compliance {
    /// Stations m.
    pub stations: usize,
    /// Distance of stations, m.
    pub spacing_m: f64,
    /// Length over which the tip's load is spread along the line.
    pub tip_length_m: f64,
    /// Compliance of the part of the body that the line enters, as one piece on its foundation, m/N; 0 where something
    /// holds it.
    pub whole_m_per_n: f64,
    /// Compliance of the needle itself, between hand and tissue, m/N; see [`behind_needle`](Self::behind_needle).
    pub needle_m_per_n: f64,
    /// m/N, 2m x 2m; with the needle's own.
    pub(super) rows: Rows,
    /// Compliance of the tip at each station that its rows lack in a tip of the needle's radius, m/N.
    pub tip_missing_m_per_n: Vec<f64>,
    /// How that falls off along the needle: what tip and shaft lack of moving each other.
    pub near: NearTip,
    /// Force on the tip at each station that opens the cut to the needle's width, N.
    pub wedge_n: Vec<f64>,
    /// Distance of stations across, m.
    pub across_spacing_m: f64,
    /// Compliance of the stations across, along the two directions, m/N; empty where they were not solved for.
    pub across: [Rows; 2],
    /// Force of the foundation on the body along the line for each newton on it, for each row.
    pub foundation: Vec<f64>,
}

impl Compliance {
    /// Makes the compliance from the answers to each station's load along the line: those of the shaft, then those of
    /// the tip.
    pub fn of_columns<T: Compiled>(
        model: &BatchModel<T>,
        stations: &Stations,
        columns: &[Column],
    ) -> Option<Compliance> {
        let m = stations.count();
        let (axial, across) = columns.split_at_checked(2 * m)?;
        let mut rows = symmetric(axial);
        for (n, missing) in stations.missing_m_per_n.iter().enumerate() {
            rows.row_mut(n)[n] += missing;
        }
        let direction = stations.line.axes[0];
        let foundation = |c: &Column| (0..3).map(|a| c.foundation_n[a] * direction[a]).sum();
        let mut sides = [Rows::default(), Rows::default()];
        let count = stations.across_count();
        for (side, columns) in sides.iter_mut().zip(across.chunks_exact(count.max(1))) {
            *side = symmetric(columns);
            // The mean over all directions across is in effect that along, times (3 - 4 nu) / (4 (1 - nu)); see
            // `physics.md`.
            for n in 0..columns.len() {
                let middle_m = (n as f64 + 0.5) * stations.group() as f64 * stations.settings.spacing_m;
                let nu = model
                    .material(stations.line.point_m(middle_m, [0.0; 2]))
                    .map_or(0.49, |m| m[1]);
                let missing = stations.across_missing_m_per_n(n);
                side.row_mut(n)[n] += missing * (3.0 - 4.0 * nu) / (4.0 * (1.0 - nu));
            }
        }
        Some(Compliance {
            stations: m,
            spacing_m: stations.settings.spacing_m,
            tip_length_m: stations.patch_edge_m(model.spacing_m()),
            whole_m_per_n: stations.part(model).m_per_n,
            needle_m_per_n: 0.0,
            across_spacing_m: stations.group() as f64 * stations.settings.spacing_m,
            rows,
            tip_missing_m_per_n: stations.tip_missing_m_per_n.clone(),
            near: stations.near.clone(),
            wedge_n: stations.wedge_n.clone(),
            across: sides,
            foundation: axial.iter().map(foundation).collect(),
        })
    }

    /// Makes stations whose forces do not move each other, for tests and examples: `each_m_per_n` at shaft and tip.
    pub fn diagonal(stations: usize, spacing_m: f64, each_m_per_n: f64) -> Compliance {
        let entry = |i: usize, j: usize| {
            if i % stations.max(1) == j % stations.max(1) {
                each_m_per_n
            } else {
                0.0
            }
        };
        Self::from_rows(stations, spacing_m, spacing_m, entry)
    }

    /// Makes the compliance from a function of two rows.
    pub fn from_rows(
        stations: usize,
        spacing_m: f64,
        tip_length_m: f64,
        entry: impl Fn(usize, usize) -> f64,
    ) -> Compliance {
        Compliance {
            stations,
            spacing_m,
            tip_length_m,
            whole_m_per_n: 0.0,
            needle_m_per_n: 0.0,
            across_spacing_m: spacing_m,
            rows: Rows::new(2 * stations, entry),
            tip_missing_m_per_n: vec![0.0; stations],
            near: NearTip::default(),
            wedge_n: vec![0.0; stations],
            across: [Rows::default(), Rows::default()],
            foundation: vec![-1.0; 2 * stations],
        }
    }

    /// Returns the force for each metre of a shaft that is stuck at every station, N/m: `1' W^-1 1`. Infinite where `W`
    /// is no compliance.
    pub fn stuck_n_per_m(&self) -> f64 {
        let matrix = nalgebra::DMatrix::from_fn(self.stations, self.stations, |i, j| self.at(i, j));
        let ones = nalgebra::DVector::from_element(self.stations, 1.0);
        let solved = matrix.cholesky().map(|factors| factors.solve(&ones).sum());
        solved.filter(|k| k.is_finite() && *k > 0.0).unwrap_or(f64::INFINITY)
    }

    /// Puts a spring between hand and tissue that makes a stuck shaft no stiffer than this: what is stiffer no loop at
    /// 1 kHz can hold still over a late link. Nothing where the tissue is soft enough by itself.
    pub fn behind_needle(mut self, stiffest_n_per_m: f64) -> Self {
        self.needle_m_per_n = (1.0 / stiffest_n_per_m - 1.0 / self.stuck_n_per_m()).max(0.0);
        if self.needle_m_per_n > 0.0 {
            for n in 0..2 * self.stations {
                let count = 2 * self.stations;
                for entry in &mut self.rows.row_mut(n)[..count] {
                    *entry += self.needle_m_per_n;
                }
            }
        }
        self
    }

    /// Returns the compliance that all stations share, m/N: of the body as a whole and of the needle itself.
    pub(super) fn common_m_per_n(&self) -> f64 {
        self.whole_m_per_n + self.needle_m_per_n
    }

    /// Returns whether the numbers of the tip are those of as many stations.
    pub(super) fn has_whole_tip(&self) -> bool {
        [&self.tip_missing_m_per_n, &self.wedge_n]
            .iter()
            .all(|each| each.len() == self.stations && each.iter().all(|v| v.is_finite() && *v >= 0.0))
            && self.near.is_whole()
    }

    /// Returns the compliance that the tip's rows lack where its load has these weights, m/N.
    pub(super) fn tip_missing_m_per_n(&self, range: std::ops::Range<usize>, weights: &[f64]) -> f64 {
        let places = self.tip_missing_m_per_n.iter().skip(range.start).zip(weights);
        places.take(range.len()).map(|(missing, weight)| missing * weight).sum()
    }

    /// Returns what a newton on a tip at `tip_m` moves station `n` of a shaft that ends at `end_m`, and a newton on the
    /// station that tip, beyond its rows, m/N; `missing` is what the tip itself lacks there.
    #[inline]
    pub(super) fn near_m_per_n(&self, missing: f64, tip_m: f64, n: usize, end_m: f64) -> f64 {
        let ds = self.spacing_m;
        let to_m = ((n + 1) as f64 * ds).min(end_m);
        // A shorter load would move itself by more than its row has.
        let from_m = (n as f64 * ds).min(to_m - SHORTEST * ds);
        missing * self.near.mean(from_m - tip_m, to_m - tip_m)
    }

    /// Returns the displacement of row `i` by a newton at row `j`, m/N.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.rows.row(i).get(j).copied().unwrap_or(f64::NAN)
    }
}

/// Returns the mean of each pair: columns that are not quite solved are not quite symmetric.
fn symmetric(columns: &[Column]) -> Rows {
    let entry = |i: usize, j: usize| columns[j].samples_m.get(i).copied().unwrap_or(0.0);
    Rows::new(columns.len(), |i, j| 0.5 * (entry(i, j) + entry(j, i)))
}

/// Green function of a line load on a square lattice of bilinear elements, spacing and shear modulus 1; for large
/// distances `-ln(r) / (2 pi)`. Made by `tests/oracles/lattice_green.py`.
const GREEN: [[f64; 5]; 5] = [
    [0.344768214, -0.018270257, -0.112937218, -0.176345437, -0.221452078],
    [-0.018270257, -0.042193314, -0.128532955, -0.183714754, -0.225939389],
    [-0.112937218, -0.128532955, -0.162833870, -0.203435836, -0.238241251],
    [-0.176345437, -0.183714754, -0.203435836, -0.229110558, -0.255678072],
    [-0.221452078, -0.225939389, -0.238241251, -0.255678072, -0.275340275],
];

fn green(i: i64, j: i64) -> f64 {
    let [i, j] = [i, j].map(|n| n.unsigned_abs() as usize);
    match GREEN.get(i).and_then(|row| row.get(j)) {
        Some(value) => *value,
        None => -(i as f64).hypot(j as f64).ln() / std::f64::consts::TAU,
    }
}

/// Radius of the cylinder that an even load would move as far as the lattice moves a station's shaft with it.
pub(super) fn lattice_radius_m<T: Compiled>(model: &BatchModel<T>, stations: &Stations, along_m: f64) -> f64 {
    let h = model.spacing_m();
    let direction = stations.line.axes[0];
    let main = (0..3)
        .max_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs()))
        .unwrap_or(2);
    let [first, second] = [(main + 1) % 3, (main + 2) % 3];
    let mut log = 0.0;
    const PLACES: usize = 4;
    for n in 0..PLACES {
        let place_m = along_m + ((n as f64 + 0.5) / PLACES as f64 - 0.5) * stations.settings.spacing_m;
        let mut weights: Vec<([i64; 2], f64)> = Vec::new();
        let around = stations.around_m();
        for across_m in around {
            let point = stations.line.point_m(place_m, across_m).map(|c| c / h);
            let (low, part) = (
                [point[first], point[second]].map(f64::floor),
                [first, second].map(|a| point[a] - point[a].floor()),
            );
            for corner in 0..4 {
                let step = [corner & 1, corner >> 1];
                let weight: f64 = (0..2)
                    .map(|a| if step[a] == 1 { part[a] } else { 1.0 - part[a] })
                    .product();
                weights.push((
                    [0, 1].map(|a| low[a] as i64 + step[a] as i64),
                    weight / around.len() as f64,
                ));
            }
        }
        for (p, w) in &weights {
            log -= weights
                .iter()
                .map(|(q, v)| w * v * green(p[0] - q[0], p[1] - q[1]))
                .sum::<f64>();
        }
    }
    h * (std::f64::consts::TAU * log / PLACES as f64).exp()
}

#[cfg(test)]
mod tests;
