//! Sample points of the search, and the dose of a seed of 1 U at each place for each of them.

use super::candidates::Candidates;
use super::misplaced::Misplaced;
use crate::plan::anatomy::Body;
use crate::plan::dose::perturb::Perturbation;
use crate::plan::dose::{DoseKernel, DosePoints, Seed};
use rayon::prelude::*;
use std::ops::Range;

/// Number of which a group's size is a multiple, padded with points of zero weight.
pub const LANES: usize = 8;
const TARGET_POINTS: f64 = 3000.0;
const URETHRA_POINTS: f64 = 400.0;
const RECTUM_POINTS: f64 = 4000.0;
/// Number of target points for the dose of misplaced seeds, which varies less from place to place.
const MISPLACED_POINTS: f64 = 1000.0;
/// Volume of the rectum that is kept, closest to the seeds: the hottest 2 cc lie there.
const RECTUM_KEPT_M3: f64 = 5e-6;
/// Volume in the limit of the rectum.
pub const RECTUM_M3: f64 = 2e-6;

/// Points of target, urethra and rectum, one group after the other.
pub struct Samples {
    /// Points of the target, weights of 1 in all.
    pub target: Range<usize>,
    /// Points of the urethra, weights of 1 in all; empty without one.
    pub urethra: Range<usize>,
    /// Points of the rectum, weights in units of [`RECTUM_M3`]; empty without one.
    pub rectum: Range<usize>,
    /// Mean dose at points of the target over the errors of a seed, weights of 1 in all.
    pub mean: Range<usize>,
    /// Variance of that dose at the same points, in squares of the prescription.
    pub variance: Range<usize>,
    /// Weight of each point.
    pub weights: Vec<f32>,
    /// Dose of the seeds in the tissue, per U of the added ones; zeros without any.
    pub present: Vec<f32>,
    /// Dose of 1 U as a share of the prescription, place by place.
    of_one_u: Vec<f32>,
}

impl Samples {
    /// Draws the points and computes the dose of each place at each of them, for the planned place
    /// and over the errors of `how`. `usual_u` is a strength in the middle of the catalogue; seeds
    /// that are `present` have their strength per U of the others.
    pub fn new(
        bodies: [Option<&Body>; 3],
        candidates: &Candidates,
        kernel: &DoseKernel,
        (prescription_gy, usual_u): (f64, f64),
        how: Perturbation,
        present: &[Seed],
    ) -> Self {
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
        let mut drawn = Drawn::default();
        let [target, urethra, rectum] = bodies;
        let of_target = drawn.add(target.map(|body| points(body, TARGET_POINTS)), None);
        let of_urethra = drawn.add(urethra.map(|body| points(body, URETHRA_POINTS)), None);
        let kept = rectum.map(|body| hottest(points(body, RECTUM_POINTS), kernel, &seeds));
        let of_rectum = drawn.add(kept, Some(RECTUM_M3));
        let planned = drawn.points_m.len();
        let mean = drawn.add(target.map(|body| points(body, MISPLACED_POINTS)), None);
        let variance = mean.end..mean.end + mean.len();
        let at = DosePoints::new(&drawn.points_m[..planned]);
        let misplaced = Misplaced::new(
            &drawn.points_m[planned..],
            how,
            (prescription_gy, usual_u),
            candidates.inwards(),
        );
        drawn.weights.resize(variance.end, 0.0);
        let of_seed = |seed: &Seed| {
            let gy = at.of_seeds_gy(kernel, std::slice::from_ref(seed));
            let mut row: Vec<f32> = gy.into_iter().map(|gy| (gy / prescription_gy) as f32).collect();
            misplaced.moments(kernel, seed.position_m, &mut row);
            row
        };
        // Seeds in the tissue are no longer misplaced: their mean is their dose, without variance.
        let share = |gy: f64| (gy / prescription_gy) as f32;
        let mut of_present: Vec<f32> = DosePoints::new(&drawn.points_m)
            .of_seeds_gy(kernel, present)
            .into_iter()
            .map(share)
            .collect();
        of_present.resize(variance.end, 0.0);
        Self {
            present: of_present,
            of_one_u: seeds.par_iter().flat_map_iter(of_seed).collect(),
            target: of_target,
            urethra: of_urethra,
            rectum: of_rectum,
            mean,
            variance,
            weights: drawn.weights,
        }
    }

    /// Returns the number of values of a place: doses at points, then means and variances.
    pub fn row_len(&self) -> usize {
        self.weights.len()
    }

    /// Returns the dose of 1 U at a place for each point, as a share of the prescription, and its
    /// moments over the errors.
    pub fn of_place(&self, place: usize) -> &[f32] {
        let count = self.row_len();
        &self.of_one_u[place * count..(place + 1) * count]
    }
}

/// Points of all groups so far.
#[derive(Default)]
struct Drawn {
    points_m: Vec<[f64; 3]>,
    weights: Vec<f32>,
}

impl Drawn {
    /// Adds points of one more structure; weights are shares of `unit_m3`, or of all.
    fn add(&mut self, of_body: Option<Vec<([f64; 3], f64)>>, unit_m3: Option<f64>) -> Range<usize> {
        let from = self.points_m.len();
        let of_body = of_body.unwrap_or_default();
        let unit_m3 = unit_m3.unwrap_or_else(|| of_body.iter().map(|p| p.1).sum());
        self.weights.extend(of_body.iter().map(|p| (p.1 / unit_m3) as f32));
        self.points_m.extend(of_body.iter().map(|p| p.0));
        let filler = self.points_m[from..].first().copied().unwrap_or_default();
        while !self.points_m.len().is_multiple_of(LANES) {
            self.points_m.push(filler);
            self.weights.push(0.0);
        }
        from..self.points_m.len()
    }
}

/// Returns about this number of points, each with its volume.
fn points(body: &Body, count: f64) -> Vec<([f64; 3], f64)> {
    let (low, high) = body.bounds_m();
    let box_m3: f64 = (0..3).map(|a| high[a] - low[a]).product();
    // An ellipsoid fills half of its box.
    let pitch_m = (0.5 * box_m3 / count).cbrt();
    let structure = body.structure(pitch_m);
    structure.points_m.into_iter().zip(structure.volumes_m3).collect()
}

/// Returns the points with the highest dose if every place has a seed.
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
