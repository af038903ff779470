//! Metal among the beams: echo of needles and seeds, reverberation behind them, and their shadow.

use super::beams::Grid;
use super::{Plane, Probe};
use crate::body::{Metal, NEEDLE_RADIUS_M, SEED_LENGTH_M, SEED_RADIUS_M};
use nalgebra::Vector3;

/// Amplitude of a needle's wall over the gland at perpendicular incidence: 32 dB.
pub const NEEDLE_ECHO: f64 = 40.0;
/// Amplitude of a seed over the gland: 26 dB.
pub const SEED_ECHO: f64 = 20.0;
/// One-way loss through a needle or a seed in the middle of the plane, dB.
pub const SHADOW_DB: f64 = 7.0;
/// Number, spacing and decay of reverberations behind the wall of a needle: sound that bounces
/// within.
const RINGS: i32 = 7;
pub const RING_M: f64 = 1.1e-3;
pub const RING_FALL: f64 = 0.55;
/// Distance between two points along the metal.
const STEP_M: f64 = 0.15e-3;
/// Smallest visible share of the whole.
const LEAST: f64 = 1e-3;

/// Echo and attenuation (dB, one way) of each sample of each beam.
#[derive(Debug, Default)]
pub struct Marks {
    pub of_sample: Vec<[f32; 2]>,
    touched: Vec<usize>,
}

struct Wall {
    radius_m: f64,
    echo: f64,
    rings: i32,
}

impl Marks {
    /// Redraws all metal near the plane.
    pub fn draw(&mut self, plane: &Plane, grid: Grid, metal: &Metal) {
        if self.of_sample.len() == grid.count() {
            self.touched.drain(..).for_each(|n| self.of_sample[n] = [0.0; 2]);
        } else {
            self.of_sample = vec![[0.0; 2]; grid.count()];
            self.touched.clear();
        }
        let needle = Wall {
            radius_m: NEEDLE_RADIUS_M,
            echo: NEEDLE_ECHO,
            rings: RINGS,
        };
        for shaft in &metal.needles {
            for ends in shaft.points_m.windows(2) {
                self.rod(plane, grid, ends[0], ends[1], &needle);
            }
        }
        let seed = Wall {
            radius_m: SEED_RADIUS_M,
            echo: SEED_ECHO,
            rings: 1,
        };
        for one in &metal.seeds {
            let half = one.axis * (0.5 * SEED_LENGTH_M);
            self.rod(plane, grid, one.middle_m - half, one.middle_m + half, &seed);
        }
    }

    fn rod(&mut self, plane: &Plane, grid: Grid, from_m: Vector3<f64>, to_m: Vector3<f64>, wall: &Wall) {
        let Some(along) = (to_m - from_m).try_normalize(1e-9) else {
            return;
        };
        let steps = ((to_m - from_m).norm() / STEP_M).ceil().min(4000.0);
        for step in 0..=steps as usize {
            let place_m = from_m + (to_m - from_m) * (step as f64 / steps);
            self.point(plane, grid, place_m, along, wall);
        }
    }

    fn point(&mut self, plane: &Plane, grid: Grid, place_m: Vector3<f64>, along: Vector3<f64>, wall: &Wall) {
        let at = plane.in_beams(place_m);
        let surface_m = at.depth_m - wall.radius_m;
        let seen = seen(&plane.probe, at.off_plane_m, at.depth_m);
        if seen < LEAST || surface_m < 0.0 || surface_m >= plane.depth_m {
            return;
        }
        let beam = match plane.view {
            super::View::Transverse => plane.pose.up * at.across.cos() + plane.right() * at.across.sin(),
            super::View::Sagittal => plane.pose.up,
        };
        let square = (1.0 - along.dot(&beam).powi(2)).max(0.02);
        let half = plane.probe.half(plane.view);
        let pitch = 2.0 * half / f64::from(grid.lines - 1);
        let wide = match plane.view {
            super::View::Transverse => wall.radius_m / (plane.probe.radius_m + at.depth_m),
            super::View::Sagittal => wall.radius_m * (1.0 - along.dot(&plane.right()).powi(2)).max(0.0).sqrt(),
        };
        let line = |across: f64| ((across + half) / pitch).round();
        let (first, last) = (line(at.across - wide), line(at.across + wide));
        let sample_m = plane.depth_m / f64::from(grid.samples - 1);
        // The pulse spreads a thin line over depths; its height must remain.
        let height = plane.probe.axial_m / sample_m * std::f64::consts::TAU.sqrt();
        for line in (first as i64..=last as i64).filter(|l| (0..i64::from(grid.lines)).contains(l)) {
            for ring in 0..=wall.rings {
                let sample = ((surface_m + f64::from(ring) * RING_M) / sample_m).round() as usize;
                if sample < grid.samples as usize {
                    let echo = wall.echo * seen * square * height * RING_FALL.powi(ring);
                    let lost_db = if ring == 0 { SHADOW_DB * seen } else { 0.0 };
                    self.put(sample * grid.lines as usize + line as usize, [echo, lost_db]);
                }
            }
        }
    }

    /// Keeps the brightest mark of a sample.
    fn put(&mut self, sample: usize, mark: [f64; 2]) {
        let old = &mut self.of_sample[sample];
        if *old == [0.0; 2] {
            self.touched.push(sample);
        }
        *old = [0, 1].map(|i| old[i].max(mark[i] as f32));
    }
}

/// Returns the share of an echo from outside the plane.
fn seen(probe: &Probe, off_plane_m: f64, depth_m: f64) -> f64 {
    (-0.5 * (off_plane_m / probe.thickness_at_m(depth_m)).powi(2)).exp()
}
