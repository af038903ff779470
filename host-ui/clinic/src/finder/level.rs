//! Value of the tissue, its noise, and the threshold of seeds.

use super::components::neighbours;
use super::{FinderError, Search};
use stylet_files::VoxelValues;

/// Values of soft tissue, in HU; in another unit, all values of a volume are used.
const SOFT: std::ops::RangeInclusive<f32> = -200.0..=300.0;
/// Share of the voxels that must be soft tissue for the volume to be in HU.
const SOFT_SHARE: f64 = 0.05;
/// Number of voxels in a median.
const SAMPLED: usize = 1 << 20;
/// Height of peaks above the tissue, in standard deviations of its noise.
const ABOVE_NOISE: f64 = 8.0;
/// Height above the tissue, in HU, below which peaks are bone or calcifications if the number of
/// seeds is unknown.
const ABOVE_BONE: f64 = 800.0;
/// Height of the threshold between tissue and the typical peak of a seed.
const SHARE_OF_PEAK: f64 = 0.3;

/// Reference values of voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Value of the tissue.
    pub tissue: f64,
    /// Standard deviation of the tissue.
    pub noise: f64,
    /// Smallest value of a seed's voxel.
    pub threshold: f64,
    /// Value at which the scanner saturates, if many voxels have it.
    pub saturated: Option<f64>,
}

/// Estimates the level from the voxels; a threshold of the search takes precedence.
pub fn of(volume: &VoxelValues<f32>, search: &Search) -> Result<Level, FinderError> {
    let every = volume.values.len().div_ceil(SAMPLED).max(1);
    let some = volume.values.iter().step_by(every).copied().filter(|v| v.is_finite());
    let all: Vec<f32> = some.collect();
    let soft: Vec<f32> = all.iter().copied().filter(|v| SOFT.contains(v)).collect();
    let is_in_hu = soft.len() as f64 > SOFT_SHARE * all.len() as f64;
    let mut of_tissue = if is_in_hu { soft } else { all };
    let tissue = median(&mut of_tissue).ok_or(FinderError::Nothing)?;
    let mut off: Vec<f32> = of_tissue.iter().map(|v| (v - tissue as f32).abs()).collect();
    // Of a normal distribution half lies within 0.6745 standard deviations.
    let noise = (median(&mut off).unwrap_or(0.0) / 0.6745).max(1.0);
    let peaks = peaks(volume, tissue + ABOVE_NOISE * noise);
    let typical = match search.count {
        Some(count) => peaks.get(count.min(peaks.len()).div_ceil(2).saturating_sub(1)),
        None => {
            let high = peaks.partition_point(|p| *p > tissue + ABOVE_BONE);
            let used = if high > 0 { high } else { peaks.len() };
            peaks.get(used / 2)
        }
    };
    let typical = *typical.ok_or(FinderError::Nothing)?;
    let highest = peaks[0];
    let at_highest = volume.values.iter().filter(|v| f64::from(**v) >= highest).count();
    Ok(Level {
        tissue,
        noise,
        threshold: search.threshold.unwrap_or(tissue + SHARE_OF_PEAK * (typical - tissue)),
        // Noise does not repeat the same highest value.
        saturated: (at_highest > 4).then_some(highest),
    })
}

fn median(values: &mut [f32]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1))
}

/// Returns values of voxels above `least` that no neighbour exceeds, highest first.
fn peaks(volume: &VoxelValues<f32>, least: f64) -> Vec<f64> {
    let mut peaks = Vec::new();
    for (n, &value) in volume.values.iter().enumerate() {
        if !value.is_finite() || f64::from(value) < least {
            continue;
        }
        if neighbours(volume, n, [true; 3]).all(|near| volume.values[near] <= value) {
            peaks.push(f64::from(value));
        }
    }
    peaks.sort_by(|a, b| b.total_cmp(a));
    peaks
}
