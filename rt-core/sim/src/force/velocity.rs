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
    /// `position_step_m` is that of the device.
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

    /// The last estimate, m/s.
    pub fn velocity_m_per_s(&self) -> &Vector3<f64> {
        &self.velocity_m_per_s
    }

    /// How old the last estimate is, on each axis: the velocity of the middle of its window.
    pub fn delay_s(&self) -> Vector3<f64> {
        self.window_s / 2.0
    }

    /// Largest error of the last estimate that rounding explains, on each axis; infinite before the second sample.
    pub fn noise_m_per_s(&self) -> Vector3<f64> {
        self.window_s.map(|window_s| self.step_m / window_s)
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
        let slopes = [
            slope(samples, |p| p.x, self.step_m),
            slope(samples, |p| p.y, self.step_m),
            slope(samples, |p| p.z, self.step_m),
        ];
        self.velocity_m_per_s = slopes.map(|(slope, _)| slope).into();
        self.window_s = slopes.map(|(_, window_s)| window_s).into();
        self.velocity_m_per_s
    }
}

/// Slope of the longest admissible line through the newest of `samples`, on one axis, and how long it is.
fn slope(samples: &[(Vector3<f64>, f64)], axis: impl Fn(&Vector3<f64>) -> f64, band_m: f64) -> (f64, f64) {
    let Some((newest, _)) = samples.first() else {
        return (0.0, 0.0);
    };
    let newest = axis(newest);
    let mut found = (0.0, 0.0);
    for (n, (oldest, age_s)) in samples.iter().enumerate().skip(1) {
        let candidate = (newest - axis(oldest)) / age_s;
        let fits = samples
            .iter()
            .take(n)
            .all(|(p, age)| (newest - candidate * age - axis(p)).abs() <= band_m);
        if !fits {
            break;
        }
        found = (candidate, *age_s);
    }
    found
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
    fn the_estimate_is_the_velocity_of_its_stated_delay_within_its_stated_noise() {
        let mut estimator = VelocityEstimator::new(STEP_M);
        // Most of 0.15 m/s, 0.94 m/s2 and 5.9 m/s3.
        let omega = std::f64::consts::TAU;
        let (mut longest, mut loudest, mut worst) = (0.0f64, 0.0f64, 0.0f64);
        for i in 0..5000 {
            let t = f64::from(i) * 1e-3;
            let v = estimator.update(&rounded(0.15 / omega * (omega * t).sin()), 1e-3).x;
            let (delay, noise) = (estimator.delay_s().x, estimator.noise_m_per_s().x);
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
