//! Seeds found in a CT volume: bright components, each split into as many seeds as its signal
//! holds.
//!
//! A seed is smaller than a voxel, so its voxels contain parts of it. The sum of their excess over
//! the tissue around them, the signal, is the same for every seed in any direction, and two seeds
//! that touch have twice as much. A component is fitted by as many seeds as its signal holds, each
//! a line of the seed's length blurred by the scanner.

mod components;
mod counts;
mod level;
mod settle;
mod shape;
mod signal;
mod split;
mod starts;

use components::Component;
use nalgebra::{Matrix3, Vector3};
use split::{Fitted, Fitter};
use stylet_files::VoxelValues;

/// Largest number of seeds in a component; a stronger signal is bone, contrast medium or a hip.
const MOST_IN_ONE: f64 = 12.0;
/// Probability below which a count is reported as doubtful.
const SURE: f64 = 0.9;
/// Seeds that overlap by more of their length than this leaves, and are nearer than this share of
/// their diameter, cannot both be there; the fit of those that touch is off by less.
const OVERLAP: f64 = 0.7;
const NEARER: f64 = 0.6;
/// Cosine above which seeds are parallel.
const PARALLEL: f64 = 0.9;
/// Deviation above which a place is reported as doubtful.
const CERTAIN_M: f64 = 0.5e-3;

/// Prior knowledge of the seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Threshold of the voxels of seeds; found from the data if not given.
    pub threshold: Option<f64>,
    /// Number of implanted seeds, if known.
    pub count: Option<usize>,
    /// Length of a seed, in m.
    pub length_m: f64,
    /// Diameter of a seed, in m.
    pub diameter_m: f64,
}

impl Default for Search {
    /// Returns seeds of 4.5 mm x 0.8 mm, of unknown number.
    fn default() -> Self {
        Self {
            threshold: None,
            count: None,
            length_m: 4.5e-3,
            diameter_m: 0.8e-3,
        }
    }
}

/// Seed that was found; patient frame of the volume (RAS).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundSeed {
    /// Place of its centre, in m.
    pub position_m: [f64; 3],
    /// Unit vector, with its sign towards the head.
    pub axis: [f64; 3],
    /// From 0 to 1: probability of the number of seeds in its component, times the share of the signal that the fit explains.
    pub confidence: f64,
    /// Standard deviation of the place by the fit, in m.
    pub deviation_m: f64,
    /// Seeds in its component.
    pub together: usize,
}

/// Bright object that leaves a doubt.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// Place (RAS), in m.
    pub place_m: [f64; 3],
    /// Its signal, in seeds.
    pub signal: f64,
    /// Number of seeds that it was counted as.
    pub counted: usize,
    /// Its highest value.
    pub peak: f64,
    /// Doubt, in words.
    pub why: String,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Seeds, from the head to the feet.
    pub seeds: Vec<FoundSeed>,
    /// Doubts, largest signal first.
    pub doubts: Vec<Doubt>,
    /// Smallest value of a seed's voxel.
    pub threshold: f64,
    /// Value of the tissue around, and its standard deviation.
    pub tissue: [f64; 2],
    /// Components of voxels above the threshold.
    pub components: usize,
    /// Components that were counted as more than one seed.
    pub split_components: usize,
    /// Blur of the scanner, standard deviation, in m.
    pub blur_m: f64,
}

/// Reason why no seed can be found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FinderError {
    /// All voxels are equal, or NaN.
    #[error("nothing in it is brighter than its tissue; is it the CT?")]
    Nothing,
    /// No voxel reaches the threshold.
    #[error("no voxel reaches {threshold}; its highest value is {highest}; choose a lower --threshold")]
    NoneAbove {
        /// The threshold.
        threshold: String,
        /// The highest value of the volume.
        highest: String,
    },
    /// Too much of the volume is above the threshold.
    #[error("{percent} % of its voxels reach {threshold}, too many for seeds; choose a higher --threshold")]
    TooMany {
        /// Share of the voxels, in percent.
        percent: String,
        /// The threshold.
        threshold: String,
    },
}

/// Finds seeds in a CT volume.
pub fn find(volume: &VoxelValues<f32>, search: &Search) -> Result<Found, FinderError> {
    let level = level::of(volume, search)?;
    let components = components::of(volume, &level)?;
    let signals: Vec<f64> = components.iter().map(|c| c.signal).collect();
    let count = |signals: &[f64]| counts::of(signals, search.count, MOST_IN_ONE);
    let first = count(&signals);
    let fitter = Fitter::calibrated(volume, &level, search, &components, &first);
    let (fits, counts) = fitter.fit_all(&components, &first, search.count, count);
    let frame = &volume.frame;
    let place = |at_m: Vector3<f64>| -> [f64; 3] { (frame.directions * at_m + frame.origin_m).into() };
    let (mut seeds, mut doubts) = (Vec::new(), Vec::new());
    for (n, (component, fit)) in components.iter().zip(&fits).enumerate() {
        let sure = counts.probability(n);
        for (seed, deviation_m) in &fit.seeds {
            seeds.push(FoundSeed {
                position_m: place(seed.middle_m),
                axis: to_the_head(&frame.directions, seed.axis),
                confidence: (sure * fit.explained).clamp(0.0, 1.0),
                deviation_m: *deviation_m,
                together: fit.seeds.len(),
            });
        }
        doubts.extend(
            doubt((component, fit), counts.signal(n), sure, search).map(|(at_m, why)| Doubt {
                place_m: place(at_m),
                signal: counts.signal(n),
                counted: fit.seeds.len(),
                peak: component.peak + level.tissue,
                why,
            }),
        );
    }
    seeds.sort_by(|a, b| b.position_m[2].total_cmp(&a.position_m[2]));
    doubts.sort_by(|a, b| b.signal.total_cmp(&a.signal));
    Ok(Found {
        threshold: level.threshold,
        tissue: [level.tissue, level.noise],
        components: components.len(),
        split_components: fits.iter().filter(|f| f.seeds.len() > 1).count(),
        blur_m: fitter.look.blur_m,
        seeds,
        doubts,
    })
}

/// Returns place and reason if a component is doubtful.
fn doubt(
    (component, fit): (&Component, &Fitted),
    signal: f64,
    sure: f64,
    search: &Search,
) -> Option<(Vector3<f64>, String)> {
    let counted = fit.seeds.len();
    let worst_m = fit.seeds.iter().map(|s| s.1).fold(0.0, f64::max);
    let why = if counted == 0 && signal > MOST_IN_ONE {
        "too large for seeds: left out".to_owned()
    } else if counted == 0 {
        "too faint for a seed: left out".to_owned()
    } else if counted > 0 && sure < SURE {
        format!("the count is {:.0} % probable", sure * 100.0)
    } else if let Some(apart_m) = in_one_place(fit, search) {
        format!(
            "two of them would lie in one place, {:.2} mm apart: it may be a marker or a calcification",
            apart_m * 1e3
        )
    } else if worst_m > CERTAIN_M {
        format!("a place is known to {:.1} mm only", worst_m * 1e3)
    } else {
        return None;
    };
    Some((component.middle_m, why))
}

/// Returns the distance of two seeds that overlap along their axes and are nearer than bodies can
/// be, m.
fn in_one_place(fit: &Fitted, search: &Search) -> Option<f64> {
    let seeds = &fit.seeds;
    let pairs = (0..seeds.len()).flat_map(|b| (0..b).map(move |a| (&seeds[a].0, &seeds[b].0)));
    let apart = pairs.filter_map(|(one, other)| {
        let off = other.middle_m - one.middle_m;
        let along = off.dot(&one.axis);
        let across_m = (off - one.axis * along).norm();
        let overlap = along.abs() < search.length_m * OVERLAP && one.axis.dot(&other.axis).abs() > PARALLEL;
        (overlap && across_m < search.diameter_m * NEARER).then_some(across_m)
    });
    apart.min_by(f64::total_cmp)
}

fn to_the_head(directions: &Matrix3<f64>, axis: Vector3<f64>) -> [f64; 3] {
    let axis = directions * axis;
    let sign = if axis.z < 0.0 { -1.0 } else { 1.0 };
    (axis * sign).into()
}

#[cfg(test)]
mod tests;
