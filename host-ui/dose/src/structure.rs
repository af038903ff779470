//! A structure as points that each represent a small volume, so that edges count with their inner
//! part.
//!
//! Points are scattered within their cells: on a regular lattice whole layers would cross a dose
//! level at once.

use rayon::prelude::*;
use stylet_random::Random;

/// Body in space.
pub trait Region: Sync {
    /// Returns the lower and upper corner of a box around it (m).
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]);
    /// Returns whether a place lies inside.
    fn contains(&self, point_m: [f64; 3]) -> bool;
}

/// Points with the volume that each represents.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Name of the structure.
    pub name: String,
    /// Points, in m.
    pub points_m: Vec<[f64; 3]>,
    /// Volume of each point, in m³.
    pub volumes_m3: Vec<f64>,
}

impl Structure {
    /// Creates one point for each cell of side `pitch_m` that the body touches, with a volume from
    /// eight samples of the cell.
    pub fn of_region(name: &str, region: &dyn Region, pitch_m: f64) -> Self {
        let (low, high) = region.bounds_m();
        let cells = cells(low, high, pitch_m);
        let layer = |k: usize| {
            let mut found = Vec::new();
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    let corner = corner(low, [i, j, k], pitch_m);
                    let mut random = Scatter::of_cell([i, j, k]);
                    found.extend(probe(region, corner, pitch_m, &mut random));
                }
            }
            found
        };
        let found: Vec<([f64; 3], f64)> = (0..cells[2]).into_par_iter().flat_map_iter(layer).collect();
        let (points_m, volumes_m3) = found.into_iter().unzip();
        Self {
            name: name.to_owned(),
            points_m,
            volumes_m3,
        }
    }

    /// Creates a whole box, one point to a cell.
    pub fn of_box(name: &str, low_m: [f64; 3], high_m: [f64; 3], pitch_m: f64) -> Self {
        let cells = cells(low_m, high_m, pitch_m);
        let sides = [0, 1, 2].map(|a| (high_m[a] - low_m[a]) / cells[a] as f64);
        let count = cells.iter().product::<usize>();
        let point = |index: usize| {
            let at = [
                index % cells[0],
                index / cells[0] % cells[1],
                index / cells[0] / cells[1],
            ];
            let within = Scatter::of_cell(at).point();
            [0, 1, 2].map(|a| low_m[a] + (at[a] as f64 + within[a]) * sides[a])
        };
        Self {
            name: name.to_owned(),
            points_m: (0..count).into_par_iter().map(point).collect(),
            volumes_m3: vec![sides.iter().product(); count],
        }
    }

    /// Returns the volume of the structure, in m³.
    pub fn volume_m3(&self) -> f64 {
        self.volumes_m3.iter().sum()
    }

    /// Returns the lower and upper corner of a box around the points (m).
    pub fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        bounds(&self.points_m)
    }
}

/// Returns the lower and upper corner of a box around points.
pub fn bounds(points_m: &[[f64; 3]]) -> ([f64; 3], [f64; 3]) {
    points_m
        .iter()
        .fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
            (
                [0, 1, 2].map(|a| low[a].min(p[a])),
                [0, 1, 2].map(|a| high[a].max(p[a])),
            )
        })
}

fn cells(low: [f64; 3], high: [f64; 3], pitch: f64) -> [usize; 3] {
    [0, 1, 2].map(|a| (((high[a] - low[a]) / pitch - 1e-9).ceil() as usize).max(1))
}

fn corner(low: [f64; 3], at: [usize; 3], pitch: f64) -> [f64; 3] {
    [0, 1, 2].map(|a| low[a] + at[a] as f64 * pitch)
}

/// Returns one of the samples that are inside, at random, to represent all of them.
fn probe(region: &dyn Region, corner: [f64; 3], pitch: f64, random: &mut Scatter) -> Option<([f64; 3], f64)> {
    let mut inside = [[0.0; 3]; 8];
    let mut count = 0;
    for eighth in 0..8 {
        let within = random.point();
        let half = [eighth & 1, eighth >> 1 & 1, eighth >> 2];
        let point = [0, 1, 2].map(|a| corner[a] + (f64::from(half[a]) + within[a]) * pitch / 2.0);
        if region.contains(point) {
            inside[count] = point;
            count += 1;
        }
    }
    let chosen = (random.unit() * count as f64) as usize;
    (count > 0).then(|| (inside[chosen.min(count - 1)], pitch.powi(3) * count as f64 / 8.0))
}

/// Numbers from 0 to 1 that depend on the cell alone.
pub struct Scatter(Random);

impl Scatter {
    /// Returns the numbers of one cell, always the same.
    pub fn of_cell(at: [usize; 3]) -> Self {
        let of_index = |mut random: Random, index: usize| Random(random.draw() ^ index as u64);
        Self(at.into_iter().fold(Random(0), of_index))
    }

    /// Returns the next number, from 0 to 1.
    pub fn unit(&mut self) -> f64 {
        self.0.unit()
    }

    /// Returns the next three numbers, from 0 to 1.
    pub fn point(&mut self) -> [f64; 3] {
        [(); 3].map(|()| self.unit())
    }
}
