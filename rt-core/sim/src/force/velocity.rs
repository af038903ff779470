//! Tip velocity from positions that come in encoder steps: first-order adaptive windowing.
//!
//! On each axis the estimate is the slope of the longest line, ending at the newest sample, that passes
//! within one encoder step of every sample under it (Janabi-Sharifi 2000). Fast motion gets a short window
//! and little delay, slow motion a long one and little noise: with a window of `n` periods `T` the delay
//! is `n T / 2` and the error of a steady motion at most `step / (n T)`. At most `WINDOW` periods: 16 ms of
//! delay and 0.94 mm/s of noise for a step of 0.03 mm at 1 kHz.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// Longest window, in periods.
pub const WINDOW: usize = 32;

/// Preallocated; one for a tip.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct VelocityEstimator {
    step_m: f64,
    /// Newest first: position, and time since it was taken.
    #[serde(with = "BigArray")]
    history: [(Vector3<f64>, f64); WINDOW + 1],
    filled: usize,
    velocity_m_per_s: Vector3<f64>,
    /// Length of the window of the last estimate, on each axis.
    window_s: Vector3<f64>,
}

impl VelocityEstimator {
    /// Makes an estimator; `position_step_m` is that of the device.
    pub fn new(position_step_m: f64) -> Self {
        Self {
            // A margin for the rounding of what lies exactly on the band.
            step_m: position_step_m * (1.0 + 1e-6) + 1e-12,
            history: [(Vector3::zeros(), 0.0); WINDOW + 1],
            filled: 0,
            velocity_m_per_s: Vector3::zeros(),
            window_s: Vector3::zeros(),
        }
    }

    /// Returns the last estimate, m/s.
    pub fn velocity_m_per_s(&self) -> &Vector3<f64> {
        &self.velocity_m_per_s
    }

    /// Forgets every sample.
    pub fn reset(&mut self) {
        self.filled = 0;
        self.velocity_m_per_s = Vector3::zeros();
    }

    /// Takes the sample of `dt_s` after the last one. A sample that is not finite, or a period that is not
    /// positive, changes nothing.
    pub fn update(&mut self, position_m: &Vector3<f64>, dt_s: f64) -> Vector3<f64> {
        let usable = position_m.iter().all(|x| x.is_finite()) && dt_s > 0.0 && dt_s.is_finite();
        if !usable {
            return self.velocity_m_per_s;
        }
        for (_, age_s) in &mut self.history {
            *age_s += dt_s;
        }
        self.history.rotate_right(1);
        if let Some(newest) = self.history.first_mut() {
            *newest = (*position_m, 0.0);
        }
        self.filled = (self.filled + 1).min(WINDOW + 1);
        let samples = self.history.get(..self.filled).unwrap_or(&[]);
        let mut per_s = [0.0; WINDOW + 1];
        for (per_s, (_, age_s)) in per_s.iter_mut().zip(&self.history) {
            *per_s = 1.0 / age_s;
        }
        let slopes = [
            slope(samples, &per_s, |p| p.x, self.step_m),
            slope(samples, &per_s, |p| p.y, self.step_m),
            slope(samples, &per_s, |p| p.z, self.step_m),
        ];
        self.velocity_m_per_s = slopes.map(|(slope, _)| slope).into();
        self.window_s = slopes.map(|(_, window_s)| window_s).into();
        self.velocity_m_per_s
    }
}

/// Largest rounding error of a comparison with the band, over the positions' own. Each has three of its own, and each
/// of the bounds below five.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// Slopes that pass each sample, so far, within a width.
struct Slopes {
    least: f64,
    most: f64,
}

impl Slopes {
    /// Range of all slopes. An infinite slope passes nothing, not even the newest sample.
    const ALL: Self = Slopes {
        least: f64::MIN,
        most: f64::MAX,
    };

    #[inline(always)]
    fn hold(&self, slope: f64) -> bool {
        (self.least <= slope) & (slope <= self.most)
    }

    #[inline(always)]
    fn pass(&mut self, middle: f64, half: f64) {
        let (least, most) = (middle - half, middle + half);
        self.least = if least > self.least { least } else { self.least };
        self.most = if most < self.most { most } else { self.most };
    }
}

/// Returns the slope and the length of the longest admissible line through the newest of `samples`, on one axis.
/// `per_s` is one over the age of each.
///
/// Samples bound the slopes of all longer lines, so that each line is compared with two numbers and not with every
/// sample. Only where rounding could decide is it compared with the samples.
fn slope(
    samples: &[(Vector3<f64>, f64)],
    per_s: &[f64; WINDOW + 1],
    axis: impl Fn(&Vector3<f64>) -> f64,
    band_m: f64,
) -> (f64, f64) {
    let Some((newest, _)) = samples.first() else {
        return (0.0, 0.0);
    };
    let newest = axis(newest);
    let largest_m = samples.iter().fold(0.0, |most: f64, (p, _)| most.max(axis(p).abs()));
    let doubt_m = ROUNDINGS * (largest_m + band_m);
    let (mut surely, mut perhaps) = (Slopes::ALL, Slopes::ALL);
    let mut found = (0.0, 0.0);
    for (n, ((oldest, age_s), per_s)) in samples.iter().zip(per_s).enumerate().skip(1) {
        let candidate = (newest - axis(oldest)) / age_s;
        let fits = if surely.hold(candidate) {
            true
        } else {
            perhaps.hold(candidate) && passes(samples.get(..n).unwrap_or(&[]), candidate, newest, &axis, band_m)
        };
        if !fits {
            break;
        }
        found = (candidate, *age_s);
        surely.pass(candidate, (band_m - doubt_m) * per_s);
        perhaps.pass(candidate, (band_m + doubt_m) * per_s);
    }
    found
}

/// Returns whether a line through the newest sample passes each of the others within the band.
#[cold]
fn passes(
    samples: &[(Vector3<f64>, f64)],
    slope: f64,
    newest: f64,
    axis: impl Fn(&Vector3<f64>) -> f64,
    band_m: f64,
) -> bool {
    samples
        .iter()
        .all(|(p, age)| (newest - slope * age - axis(p)).abs() <= band_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_M: f64 = 3e-5;

    fn rounded(x: f64) -> Vector3<f64> {
        Vector3::new((x / STEP_M).round() * STEP_M, 0.0, 0.0)
    }

    #[test]
    fn steady_motion_is_found_within_one_step_a_window() {
        for speed in [0.0, 0.0007, 0.003, 0.048, -0.123, 0.28] {
            let mut estimator = VelocityEstimator::new(STEP_M);
            let mut worst = 0.0f64;
            for i in 0..500 {
                let v = estimator.update(&rounded(speed * f64::from(i) * 1e-3 + 1.1e-5), 1e-3);
                if i > WINDOW as i32 {
                    worst = worst.max((v.x - speed).abs());
                }
            }
            let bound = STEP_M / (WINDOW as f64 * 1e-3);
            assert!(worst <= bound * 1.001, "speed {speed}: {worst}");
        }
    }

    /// Against the motion itself: a tip that speeds up and turns back within a second.
    #[test]
    fn the_estimate_is_within_its_stated_delay_and_noise() {
        let mut estimator = VelocityEstimator::new(STEP_M);
        // Most of 0.15 m/s, 0.94 m/s2 and 5.9 m/s3.
        let omega = std::f64::consts::TAU;
        let (mut longest, mut loudest, mut worst) = (0.0f64, 0.0f64, 0.0f64);
        for i in 0..5000 {
            let t = f64::from(i) * 1e-3;
            let v = estimator.update(&rounded(0.15 / omega * (omega * t).sin()), 1e-3).x;
            let window_s = estimator.window_s.x;
            let (delay, noise) = (window_s / 2.0, STEP_M / window_s);
            if i <= WINDOW as i32 {
                continue;
            }
            let then = 0.15 * (omega * (t - delay)).cos();
            assert!((v - then).abs() <= 2.0 * noise, "{v} for {then} m/s, noise {noise}");
            (longest, loudest) = (longest.max(delay), loudest.max(noise));
            worst = worst.max((v - 0.15 * (omega * t).cos()).abs());
        }
        println!(
            "delay up to {:.1} ms, noise up to {:.2} mm/s, error up to {:.2} mm/s",
            longest * 1e3,
            loudest * 1e3,
            worst * 1e3
        );
        assert!(longest <= 0.016 + 1e-9);
    }

    #[test]
    fn a_tip_at_rest_on_the_edge_of_a_step_stays_below_the_hold_speed() {
        let hold = crate::needle::NeedleParameters::default().hold_speed_m_per_s;
        let mut estimator = VelocityEstimator::new(STEP_M);
        for i in 0..10_000u32 {
            let flicker = f64::from(i.wrapping_mul(2_654_435_761) >> 31) * STEP_M;
            let v = estimator.update(&Vector3::new(flicker, 0.0, 0.0), 1e-3);
            if i > WINDOW as u32 {
                assert!(v.x.abs() < hold, "{} m/s in tick {i}", v.x);
            }
        }
    }

    #[test]
    fn a_stop_is_seen_long_before_the_window_is_over() {
        let mut estimator = VelocityEstimator::new(STEP_M);
        let position = |i: i32| 0.1 * f64::from(i.min(200)) * 1e-3;
        let seen = (0..300)
            .map(|i| estimator.update(&rounded(position(i)), 1e-3).x)
            .skip(201)
            .position(|v| v.abs() < 0.01);
        assert!(seen.is_some_and(|ticks| ticks <= 4), "{seen:?}");
    }

    /// Returns the longest line that passes every sample under it, each compared with each.
    fn by_brute_force(samples: &[f64], dt_s: f64) -> (f64, f64) {
        let band_m = VelocityEstimator::new(STEP_M).step_m;
        let mut ages_s = vec![0.0];
        ages_s.extend((0..WINDOW).scan(0.0, |age_s, _| {
            *age_s += dt_s;
            Some(*age_s)
        }));
        let newest = samples[0];
        let mut found = (0.0, 0.0);
        for n in 1..samples.len().min(WINDOW + 1) {
            let slope = (newest - samples[n]) / ages_s[n];
            let is_passed = |i: usize| (newest - slope * ages_s[i] - samples[i]).abs() <= band_m;
            if !(0..n).all(is_passed) {
                break;
            }
            found = (slope, ages_s[n]);
        }
        found
    }

    /// Bit by bit, on paths that lie on the edge of the band or off it by roundings.
    #[test]
    fn bounds_of_slopes_give_what_comparing_every_sample_gives() {
        let mut random = stylet_random::Random(1);
        let mut draw = |of: usize| random.below(of);
        let exact = STEP_M * (1.0 + 1e-6) + 1e-12;
        for path in 0..400 {
            let dt_s = [1e-3, 1e-4, 0.8e-3][path % 3];
            let start_m = [0.0, 0.1, -0.25, 7.0][path % 4];
            let (mut estimator, mut x, mut samples) = (VelocityEstimator::new(STEP_M), start_m, Vec::new());
            for _ in 0..200 {
                x += match path % 5 {
                    0 => exact * draw(3) as f64 - exact,
                    1 => STEP_M * (draw(2) as f64),
                    2 => exact * (draw(2) as f64) * (1.0 + f64::EPSILON * draw(9) as f64),
                    3 => 1e-6 * draw(100) as f64,
                    _ => 0.0,
                };
                samples.insert(0, x);
                let given = estimator.update(&Vector3::new(x, 0.0, -x), dt_s);
                let (slope, window_s) = by_brute_force(&samples, dt_s);
                assert_eq!(given.x.to_bits(), slope.to_bits(), "path {path}");
                assert_eq!(estimator.window_s.x, window_s);
            }
        }
    }

    #[test]
    fn bad_samples_change_nothing() {
        let mut estimator = VelocityEstimator::new(STEP_M);
        for i in 0..50 {
            estimator.update(&rounded(0.05 * f64::from(i) * 1e-3), 1e-3);
        }
        let before = *estimator.velocity_m_per_s();
        for (x, dt) in [(f64::NAN, 1e-3), (0.0, 0.0), (0.0, f64::NAN), (0.0, -1.0)] {
            assert_eq!(estimator.update(&Vector3::new(x, 0.0, 0.0), dt), before);
        }
    }
}
