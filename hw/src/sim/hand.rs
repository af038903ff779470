//! The hand that holds the device: a mass on a spring and a damper, and the effort of the operator.

use nalgebra::Vector3;

/// Passive impedance of a hand, and the effort of the operator.
///
/// The spring and the damper act between the [`HandPath`](crate::HandPath) and the device; the mass is
/// carried by the device. Human hands lie within 0.1-1 kg, 2-20 N s/m and 50-1000 N/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// Mass that moves with the device.
    pub mass_kg: f64,
    /// Passive damping.
    pub damping_n_s_per_m: f64,
    /// Passive stiffness.
    pub stiffness_n_per_m: f64,
    /// Effort of the operator. Without it, the hand is passive and yields to the force.
    pub effort: Option<Effort>,
}

/// Response of an operator to a needle that lags behind: braces the arm, and pushes harder until
/// the needle follows. Not passive; for scripted insertions, not for tests of stability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Growth of the push per second and metre of lag.
    pub gain_n_per_m_s: f64,
    /// Largest push.
    pub limit_n: f64,
    /// Lag that the operator does not notice. Without it the push oscillates against dry friction.
    pub unnoticed_m: f64,
    /// Stiffness that bracing adds to the passive one.
    pub bracing_stiffness_n_per_m: f64,
    /// Damping that bracing adds. Keeps the jump at puncture to a few millimetres.
    pub bracing_damping_n_s_per_m: f64,
}

impl Effort {
    /// Creates an operator who inserts a needle carefully.
    pub const fn steady() -> Self {
        Self {
            gain_n_per_m_s: 6000.0,
            limit_n: 12.0,
            unnoticed_m: 1e-4,
            bracing_stiffness_n_per_m: 700.0,
            bracing_damping_n_s_per_m: 40.0,
        }
    }
}

impl Hand {
    /// Creates a yielding hand in the middle of the envelope.
    pub const fn passive() -> Self {
        Self {
            mass_kg: 0.5,
            damping_n_s_per_m: 5.0,
            stiffness_n_per_m: 300.0,
            effort: None,
        }
    }

    /// Returns the same hand, with an operator who pushes until the needle reaches its goal.
    pub const fn steady() -> Self {
        Self {
            effort: Some(Effort::steady()),
            ..Self::passive()
        }
    }

    /// Creates a device without a hand on it.
    pub const fn absent() -> Self {
        Self {
            mass_kg: 0.0,
            damping_n_s_per_m: 0.0,
            stiffness_n_per_m: 0.0,
            effort: None,
        }
    }

    /// Returns the stiffness of the hand with bracing.
    pub fn total_stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m + self.effort.map_or(0.0, |e| e.bracing_stiffness_n_per_m)
    }

    /// Returns the damping of the hand with bracing.
    pub fn total_damping_n_s_per_m(&self) -> f64 {
        self.damping_n_s_per_m + self.effort.map_or(0.0, |e| e.bracing_damping_n_s_per_m)
    }

    /// Returns the push after `dt_s` more of `lag_m` (path minus tip).
    pub fn push_n(&self, push_n: &Vector3<f64>, lag_m: &Vector3<f64>, dt_s: f64) -> Vector3<f64> {
        let Some(effort) = self.effort else {
            return Vector3::zeros();
        };
        let lag = lag_m.norm();
        if lag <= effort.unnoticed_m {
            return *push_n;
        }
        let noticed = lag_m * (1.0 - effort.unnoticed_m / lag);
        let grown = push_n + noticed * (effort.gain_n_per_m_s * dt_s);
        let size = grown.norm();
        if size > effort.limit_n {
            grown * (effort.limit_n / size)
        } else {
            grown
        }
    }
}
