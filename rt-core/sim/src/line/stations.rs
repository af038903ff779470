//! Stations along the needle's way through the tissue at rest, and where each of them loads the lattice.

use super::near::{CUBE_PER_RADIUS, NearTip};
use crate::tissue::fem::Compiled;
use crate::tissue::fem::batch::{BatchModel, NodeWeight, Part};
use serde::{Deserialize, Serialize};

/// Spread of a patch by the lattice, in squares of its spacing: 2 by the variance of trilinear weights, less by
/// measurement (own compliance 2.7 to 3 % too large with 2, against the rigid sphere).
const SPREAD: f64 = 1.2;
/// Samples of a station's length, and around the needle.
const ALONG: usize = 4;
const AROUND: usize = 8;
/// Samples across the patch that the tip loads.
const ACROSS: usize = 8;

/// Outer radius of an 18 G needle, m (nominal outer diameter 1.27 mm).
pub const NEEDLE_RADIUS_M: f64 = 0.635e-3;

/// A straight way in the scene frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Place where it enters the body.
    pub entry_m: [f64; 3],
    /// Unit vectors: inwards, and two across.
    pub axes: [[f64; 3]; 3],
}

impl Line {
    /// Makes a line; `None` where a number is not finite or the direction has no length.
    pub fn new(entry_m: [f64; 3], direction: [f64; 3]) -> Option<Line> {
        let along = nalgebra::Vector3::from(direction).try_normalize(1e-9)?;
        let least = (0..3).min_by(|&a, &b| along[a].abs().total_cmp(&along[b].abs()))?;
        let mut other = nalgebra::Vector3::zeros();
        other[least] = 1.0;
        let first = (other - along * along.dot(&other)).try_normalize(1e-9)?;
        let second = along.cross(&first);
        let is_finite = entry_m.iter().all(|c| c.is_finite()) && along.iter().all(|c| c.is_finite());
        is_finite.then_some(Line {
            entry_m,
            axes: [along, first, second].map(Into::into),
        })
    }

    /// Returns the point so far along, and so far across.
    pub fn point_m(&self, along_m: f64, across_m: [f64; 2]) -> [f64; 3] {
        let [t, a, b] = &self.axes;
        [0, 1, 2].map(|c| self.entry_m[c] + along_m * t[c] + across_m[0] * a[c] + across_m[1] * b[c])
    }
}

/// Loads of a needle on the tissue along its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationSettings {
    /// Distance of stations; about the lattice's.
    pub spacing_m: f64,
    /// Radius of the needle, m.
    pub needle_radius_m: f64,
    /// Radius of the rigid sphere that the tip's patch on the lattice stands for: the widest load that is still local.
    /// What moves nearer to the tip than that is added in closed form, so a result does not depend on it.
    pub tip_radius_m: f64,
}

impl StationSettings {
    /// Returns the settings of an 18 G needle, a station for each element on the way.
    pub fn of_lattice(spacing_m: f64) -> Self {
        StationSettings {
            spacing_m,
            needle_radius_m: NEEDLE_RADIUS_M,
            tip_radius_m: 2.5e-3,
        }
    }
}

/// Stations in order of depth; number j is the shaft from `j` to `j + 1` spacings behind the entry.
#[derive(Clone, Debug)]
pub struct Stations {
    /// The line that the stations lie on.
    pub line: Line,
    /// Settings that they were made with.
    pub settings: StationSettings,
    /// Nodes and weights, which add up to 1, of the shaft in each station.
    pub shaft: Vec<Vec<(u32, f64)>>,
    /// The same for the patch that the tip loads in each station.
    pub tip: Vec<Vec<(u32, f64)>>,
    /// Compliance of each station that the lattice lacks, m/N: see `compliance`.
    pub missing_m_per_n: Vec<f64>,
    /// Compliance of the tip at each station that its patch lacks in a tip of the needle's radius, m/N.
    pub tip_missing_m_per_n: Vec<f64>,
    /// How that falls off along the needle.
    pub near: NearTip,
    /// Force on the tip at each station that opens the cut to the needle's width, N.
    pub wedge_n: Vec<f64>,
}

impl Stations {
    /// Makes as many stations as lie inside the body from the entry on, `most` at most.
    pub fn along<T: Compiled>(model: &BatchModel<T>, line: Line, settings: StationSettings, most: usize) -> Stations {
        let mut stations = Stations {
            line,
            settings,
            shaft: Vec::new(),
            tip: Vec::new(),
            missing_m_per_n: Vec::new(),
            tip_missing_m_per_n: Vec::new(),
            near: NearTip::default(),
            wedge_n: Vec::new(),
        };
        let radius_m = settings.needle_radius_m;
        let patch_radius_m = stations.patch_radius_m(model.spacing_m());
        let beyond_patch = (1.0 / radius_m - 1.0 / patch_radius_m).max(0.0);
        for n in 0..most {
            let middle_m = (n as f64 + 0.5) * settings.spacing_m;
            let Some([shear_pa, nu]) = model.material(line.point_m(middle_m, [0.0; 2])) else {
                break;
            };
            let (shaft, tip) = (
                stations.shaft_weights(model, middle_m),
                stations.tip_weights(model, middle_m),
            );
            if shaft.is_empty() || tip.is_empty() {
                break;
            }
            let ratio = super::compliance::lattice_radius_m(model, &stations, middle_m) / radius_m;
            let per_length = ratio.ln().max(0.0) / (std::f64::consts::TAU * shear_pa);
            if n == 0 {
                stations.near = NearTip::new(radius_m, patch_radius_m, nu);
            }
            stations.missing_m_per_n.push(per_length / settings.spacing_m);
            stations
                .tip_missing_m_per_n
                .push(sphere_m2_per_n(shear_pa, nu) * beyond_patch);
            stations
                .wedge_n
                .push(std::f64::consts::PI * shear_pa * radius_m * radius_m);
            stations.shaft.push(shaft);
            stations.tip.push(tip);
        }
        stations
    }

    /// Returns the part of the body that the line enters.
    pub fn part<T: Compiled>(&self, model: &BatchModel<T>) -> Part {
        let node = self.shaft.first().and_then(|weights| weights.first());
        node.and_then(|(node, _)| model.part_of(*node))
            .cloned()
            .unwrap_or_default()
    }

    /// Returns the number of stations.
    pub fn count(&self) -> usize {
        self.shaft.len()
    }

    /// Returns the places of the samples around the needle, across its axis.
    pub(super) fn around_m(&self) -> [[f64; 2]; AROUND] {
        std::array::from_fn(|n| {
            let (sine, cosine) = (std::f64::consts::TAU * (n as f64 + 0.5) / AROUND as f64).sin_cos();
            [cosine, sine].map(|c| c * self.settings.needle_radius_m)
        })
    }

    fn shaft_weights<T: Compiled>(&self, model: &BatchModel<T>, middle_m: f64) -> Vec<(u32, f64)> {
        let across = self.around_m();
        self.mean(model, middle_m, &across)
    }

    /// Returns the weights of the tip's patch, which is narrower than its cube by the spread of trilinear weights.
    fn tip_weights<T: Compiled>(&self, model: &BatchModel<T>, middle_m: f64) -> Vec<(u32, f64)> {
        // So many samples have that much less variance than the box that they stand for.
        let edge_m = self.patch_edge_m(model.spacing_m()) / (1.0 - 1.0 / (ACROSS * ACROSS) as f64).sqrt();
        let at = |n: usize| ((n as f64 + 0.5) / ACROSS as f64 - 0.5) * edge_m;
        let across: Vec<_> = (0..ACROSS * ACROSS).map(|n| [at(n % ACROSS), at(n / ACROSS)]).collect();
        self.mean(model, middle_m, &across)
    }

    /// Returns the edge of the box that is spread over the lattice to load it as the tip does.
    pub fn patch_edge_m(&self, lattice_spacing_m: f64) -> f64 {
        let cube_m = CUBE_PER_RADIUS * self.settings.tip_radius_m;
        (cube_m.powi(2) - SPREAD * lattice_spacing_m.powi(2)).max(0.0).sqrt()
    }

    /// Returns the radius of the sphere that this box moves tissue as: of the tip's, or of the smallest that the
    /// lattice can load.
    fn patch_radius_m(&self, lattice_spacing_m: f64) -> f64 {
        let least_m = SPREAD.sqrt() * lattice_spacing_m / CUBE_PER_RADIUS;
        self.settings.tip_radius_m.max(least_m)
    }

    /// Returns the mean of trilinear weights over samples; those outside the body do not count.
    fn mean<T: Compiled>(&self, model: &BatchModel<T>, middle_m: f64, across: &[[f64; 2]]) -> Vec<(u32, f64)> {
        let mut all = Vec::new();
        let mut count = 0.0;
        for n in 0..ALONG {
            let along_m = middle_m + ((n as f64 + 0.5) / ALONG as f64 - 0.5) * self.settings.spacing_m;
            for &across_m in across {
                let Some(nodes) = model.trilinear(self.line.point_m(along_m, across_m)) else {
                    continue;
                };
                count += 1.0;
                all.extend(nodes);
            }
        }
        all.sort_by_key(|(node, _)| *node);
        let mut merged: Vec<(u32, f64)> = Vec::new();
        for (node, weight) in all.into_iter().filter(|(_, w)| *w != 0.0) {
            match merged.last_mut() {
                Some((last, sum)) if *last == node => *sum += weight / count,
                _ => merged.push((node, weight / count)),
            }
        }
        merged
    }

    /// Weights along one of the line's axes.
    pub fn load(&self, weights: &[(u32, f64)], axis: usize) -> Vec<NodeWeight> {
        let direction = self.line.axes[axis.min(2)];
        let entry = |&(node, weight): &(u32, f64)| NodeWeight {
            node,
            weight: direction.map(|c| c * weight),
        };
        weights.iter().map(entry).collect()
    }
}

/// Returns how far a newton moves a rigid sphere in its medium, times the sphere's radius, m²/N.
fn sphere_m2_per_n(shear_pa: f64, nu: f64) -> f64 {
    (5.0 - 6.0 * nu) / (24.0 * std::f64::consts::PI * shear_pa * (1.0 - nu))
}
