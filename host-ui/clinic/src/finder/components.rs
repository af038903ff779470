//! Connected voxels above the threshold, with their neighbours that hold the rest of the signal.

use super::FinderError;
use super::counts::median;
use super::level::Level;
use super::shape::Patch;
use nalgebra::Vector3;
use stylet_files::VoxelValues;

/// Radius around a component that contains the rest of its signal.
const REACH_M: f64 = 2.5e-3;
/// Margin in voxels around a component's box that shows the tissue.
const ROOM: usize = 2;
/// Largest share of the volume above the threshold; more is not an implant.
const MOST_SHARE: f64 = 0.05;
const NONE: u32 = 0;

/// Component; places in the frame of the voxels (m along each axis, from the centre of the first
/// voxel).
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Indices of its voxels and of their neighbours, in the order of the volume.
    pub voxels: Vec<usize>,
    /// Value above the tissue, of each of the voxels.
    pub excess: Vec<f64>,
    /// Value of the tissue around it above that of the volume: tissue is uneven, and a component
    /// has many voxels.
    pub tissue: f64,
    /// Sum of the values above the tissue around it; at least that of its bright voxels, because
    /// dark streaks of metal may take away the rest.
    pub signal: f64,
    /// Sum of the bright voxels alone.
    pub core: f64,
    /// Highest value above the tissue.
    pub peak: f64,
    /// Centre of the signal.
    pub middle_m: Vector3<f64>,
}

/// Returns the components of the volume, in the order of their first voxels.
pub fn of(volume: &VoxelValues<f32>, level: &Level) -> Result<Vec<Component>, FinderError> {
    let is_bright = |n: usize| f64::from(volume.values[n]) >= level.threshold;
    let bright = (0..volume.values.len()).filter(|&n| is_bright(n)).count();
    if bright == 0 {
        let highest = volume.values.iter().copied().filter(|v| v.is_finite());
        return Err(FinderError::NoneAbove {
            threshold: format!("{:.0}", level.threshold),
            highest: format!("{:.0}", highest.fold(f32::NEG_INFINITY, f32::max)),
        });
    }
    let share = bright as f64 / volume.values.len() as f64;
    if share > MOST_SHARE && bright > 10_000 {
        return Err(FinderError::TooMany {
            percent: format!("{:.1}", share * 100.0),
            threshold: format!("{:.0}", level.threshold),
        });
    }
    let mut owners = vec![NONE; volume.values.len()];
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for first in (0..volume.values.len()).filter(|&n| is_bright(n)) {
        if owners[first] != NONE {
            continue;
        }
        let owner = groups.len() as u32 + 1;
        owners[first] = owner;
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            for near in neighbours(volume, group[next], [true; 3]) {
                if owners[near] == NONE && is_bright(near) {
                    owners[near] = owner;
                    group.push(near);
                }
            }
            next += 1;
        }
        groups.push(group);
    }
    surround(volume, &mut owners, &mut groups);
    Ok(groups
        .into_iter()
        .map(|voxels| component(volume, level, voxels))
        .collect())
}

/// Gives every component the voxels around it, ring by ring; one between two belongs to the first.
fn surround(volume: &VoxelValues<f32>, owners: &mut [u32], groups: &mut [Vec<usize>]) {
    let mut from: Vec<usize> = vec![0; groups.len()];
    for ring in 1.. {
        let spacing_m = volume.frame.spacing_m;
        let along = spacing_m.map(|side| ring == 1 || f64::from(ring) * side <= REACH_M);
        if along == [false; 3] {
            return;
        }
        for (n, group) in groups.iter_mut().enumerate() {
            let (first, last) = (from[n], group.len());
            from[n] = last;
            for at in first..last {
                for near in neighbours(volume, group[at], along) {
                    if owners[near] == NONE {
                        owners[near] = n as u32 + 1;
                        group.push(near);
                    }
                }
            }
        }
    }
}

fn component(volume: &VoxelValues<f32>, level: &Level, mut voxels: Vec<usize>) -> Component {
    voxels.sort_unstable();
    let excess = |n: &usize| match f64::from(volume.values[*n]) - level.tissue {
        value if value.is_finite() => value,
        _ => 0.0,
    };
    let excess: Vec<f64> = voxels.iter().map(excess).collect();
    let tissue = tissue_around(volume, level, &voxels);
    let signal: f64 = excess.iter().map(|excess| excess - tissue).sum();
    let bright = excess
        .iter()
        .filter(|excess| **excess >= level.threshold - level.tissue);
    let core = bright.map(|excess| excess - tissue.max(0.0)).sum();
    let weighted = voxels
        .iter()
        .zip(&excess)
        .map(|(n, e)| place_m(volume, *n) * e.max(0.0));
    let weight: f64 = excess.iter().map(|e| e.max(0.0)).sum();
    Component {
        middle_m: weighted.sum::<Vector3<f64>>() / weight.max(f64::MIN_POSITIVE),
        tissue,
        signal: signal.max(core),
        core,
        peak: excess.iter().copied().fold(0.0, f64::max),
        excess,
        voxels,
    }
}

/// Returns the median excess of the voxels around a component over the tissue of the volume; other
/// seeds have fewer than half of them.
fn tissue_around(volume: &VoxelValues<f32>, level: &Level, voxels: &[usize]) -> f64 {
    let patch = Patch::of(volume.dims, volume.frame.spacing_m, voxels);
    let around = patch.with_room(volume.dims, ROOM);
    let outside = around.into_iter().filter(|n| voxels.binary_search(n).is_err());
    let values = outside.map(|n| f64::from(volume.values[n])).filter(|v| v.is_finite());
    median(values.map(|value| value - level.tissue).collect())
}

/// Returns the centre of a voxel, along the axes of the volume.
pub fn place_m(volume: &VoxelValues<f32>, n: usize) -> Vector3<f64> {
    let at = index(volume.dims, n);
    Vector3::from([0, 1, 2].map(|a| at[a] as f64 * volume.frame.spacing_m[a]))
}

/// Returns the indices of a voxel along each axis.
pub fn index([nx, ny, _]: [usize; 3], n: usize) -> [usize; 3] {
    [n % nx, n / nx % ny, n / nx / ny]
}

/// Returns up to 26 neighbours of a voxel, in the allowed directions.
pub fn neighbours(volume: &VoxelValues<f32>, n: usize, along: [bool; 3]) -> impl Iterator<Item = usize> {
    let dims = volume.dims;
    let at = index(dims, n);
    let range = move |a: usize| match along[a] {
        true => at[a].saturating_sub(1)..(at[a] + 2).min(dims[a]),
        false => at[a]..at[a] + 1,
    };
    let [nx, ny, _] = dims;
    range(2).flat_map(move |k| range(1).flat_map(move |j| range(0).map(move |i| (k * ny + j) * nx + i)))
}
