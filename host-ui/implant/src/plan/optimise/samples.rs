//! Points that the search looks at, and the dose that a seed of 1 U at each place gives to each of them.

use super::candidates::Candidates;
use crate::plan::anatomy::Body;
use crate::plan::dose::{DoseKernel, DosePoints, Seed};
use std::ops::Range;

/// Points of a group are filled up to a multiple of this with points that count nothing.
pub const LANES: usize = 8;
const TARGET_POINTS: f64 = 3000.0;
const URETHRA_POINTS: f64 = 400.0;
const RECTUM_POINTS: f64 = 4000.0;
/// Of the rectum only so much is kept, where seeds reach most: the hottest 2 cc lie there.
const RECTUM_KEPT_M3: f64 = 5e-6;
/// The volume that the limit of the rectum is about.
pub const RECTUM_M3: f64 = 2e-6;

/// Points of target, urethra and rectum, one group after the other.
pub struct Samples {
    /// Points of the target, weights of 1 in all.
    pub target: Range<usize>,
    /// Points of the urethra, weights of 1 in all; empty without one.
    pub urethra: Range<usize>,
    /// Points of the rectum, weights in units of [`RECTUM_M3`]; empty without one.
    pub rectum: Range<usize>,
    /// Weight of each point.
    pub weights: Vec<f32>,
    /// Dose of 1 U as a share of the prescription, place by place.
    of_one_u: Vec<f32>,
}

impl Samples {
    /// Draws the points and computes the dose of each place at each of them.
    pub fn new(bodies: [Option<&Body>; 3], candidates: &Candidates, kernel: &DoseKernel, prescription_gy: f64) -> Self {
        let axis = Some(candidates.inwards());
        let seeds: Vec<Seed> = candidates
            .places
            .iter()
            .map(|place| Seed {
                position_m: place.position_m,
                axis,
                strength_u: 1.0,
            })
            .collect();
        let (mut points_m, mut weights) = (Vec::new(), Vec::new());
        let counts = [TARGET_POINTS, URETHRA_POINTS, RECTUM_POINTS];
        let mut ranges = Vec::new();
        for (group, (body, count)) in bodies.into_iter().zip(counts).enumerate() {
            let from = points_m.len();
            if let Some(body) = body {
                let mut of_body = points(body, count);
                if group == 2 {
                    of_body = hottest(of_body, kernel, &seeds);
                }
                let all_m3: f64 = of_body.iter().map(|p| p.1).sum();
                let unit_m3 = if group == 2 { RECTUM_M3 } else { all_m3 };
                weights.extend(of_body.iter().map(|p| (p.1 / unit_m3) as f32));
                points_m.extend(of_body.iter().map(|p| p.0));
                let filler = points_m[from..].first().copied().unwrap_or_default();
                while !points_m.len().is_multiple_of(LANES) {
                    points_m.push(filler);
                    weights.push(0.0);
                }
            }
            ranges.push(from..points_m.len());
        }
        let at = DosePoints::new(&points_m);
        let of_seed = |seed: &Seed| at.of_seeds_gy(kernel, std::slice::from_ref(seed));
        let of_one_u = seeds
            .iter()
            .flat_map(|seed| of_seed(seed).into_iter().map(|gy| (gy / prescription_gy) as f32));
        Self {
            of_one_u: of_one_u.collect(),
            target: ranges[0].clone(),
            urethra: ranges[1].clone(),
            rectum: ranges[2].clone(),
            weights,
        }
    }

    /// Points of all groups.
    pub fn count(&self) -> usize {
        self.weights.len()
    }

    /// What a seed of 1 U at a place gives to each point, as a share of the prescription.
    pub fn of_place(&self, place: usize) -> &[f32] {
        let count = self.count();
        &self.of_one_u[place * count..(place + 1) * count]
    }
}

/// About so many points, with the volume that each stands for.
fn points(body: &Body, count: f64) -> Vec<([f64; 3], f64)> {
    let (low, high) = body.bounds_m();
    let box_m3: f64 = (0..3).map(|a| high[a] - low[a]).product();
    // An ellipsoid fills half of its box.
    let pitch_m = (0.5 * box_m3 / count).cbrt();
    let structure = body.structure(pitch_m);
    structure.points_m.into_iter().zip(structure.volumes_m3).collect()
}

/// The points that get most if every place has a seed.
fn hottest(points: Vec<([f64; 3], f64)>, kernel: &DoseKernel, seeds: &[Seed]) -> Vec<([f64; 3], f64)> {
    let places: Vec<[f64; 3]> = points.iter().map(|p| p.0).collect();
    let gy = DosePoints::new(&places).of_seeds_gy(kernel, seeds);
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| gy[b].total_cmp(&gy[a]).then(a.cmp(&b)));
    let mut kept_m3 = 0.0;
    let is_kept = |&point: &usize| {
        kept_m3 += points[point].1;
        kept_m3 <= RECTUM_KEPT_M3
    };
    order
        .into_iter()
        .take_while(is_kept)
        .map(|point| points[point])
        .collect()
}
