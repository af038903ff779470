//! Share of the needle's motion that the held tissue follows (paper eq. 6, 7), and puncture of membranes.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::settings::{Problem, Problems};
pub use stylet_settings::Phase;

/// The coefficients of eq. 6, for one membrane and the tissue behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NeedleParameters {
    /// `u_cri`: how far the membrane is pushed in before it gives way.
    pub puncture_depth_m: f64,
    /// `K_V` of eq. 6; not the damping of eq. 9, which has the same symbol.
    pub speed_coefficient_m2_per_s2: f64,
    /// `K_s`: the square of the depth past puncture at which the tissue follows by 1/e.
    pub depth_coefficient_m2: f64,
    /// `V0`: up to this speed the tissue follows a slow needle as well as it can.
    pub static_speed_m_per_s: f64,
    /// `K_ret`: part of the tip's motion that the tissue follows on the way out.
    pub retraction_ratio: f64,
    /// Distance of the tip before the place where contact began, at which a punctured membrane closes.
    pub hysteresis_m: f64,
    /// Slower than this along the path, the needle holds: `v.r = 0` for a velocity with noise. Above the
    /// noise of the estimator, or the noise is rectified into drift.
    pub hold_speed_m_per_s: f64,
}

impl Default for NeedleParameters {
    /// Returns a capsule that gives way at 8 mm, tissue that follows for about 14 mm behind it, and the mean clinical
    /// tip speed (48 mm/s) well below the speed at which the tissue follows less.
    fn default() -> Self {
        Self {
            puncture_depth_m: 8e-3,
            speed_coefficient_m2_per_s2: 1e-2,
            depth_coefficient_m2: 2e-4,
            static_speed_m_per_s: 0.02,
            retraction_ratio: 0.3,
            hysteresis_m: 5e-4,
            hold_speed_m_per_s: 2e-3,
        }
    }
}

impl NeedleParameters {
    /// Returns every setting that cannot be used, or `Ok`.
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        problems.range("needle.puncture_depth_m", self.puncture_depth_m, 1e-4, 0.05);
        problems.range(
            "needle.speed_coefficient_m2_per_s2",
            self.speed_coefficient_m2_per_s2,
            1e-6,
            1e3,
        );
        problems.range("needle.depth_coefficient_m2", self.depth_coefficient_m2, 1e-10, 1.0);
        problems.range("needle.static_speed_m_per_s", self.static_speed_m_per_s, 0.0, 1.0);
        problems.range("needle.retraction_ratio", self.retraction_ratio, 0.0, 1.0);
        problems.range("needle.hysteresis_m", self.hysteresis_m, 0.0, 0.01);
        problems.range("needle.hold_speed_m_per_s", self.hold_speed_m_per_s, 0.0, 0.05);
        problems.finish()
    }
}

/// One tick of the needle, as its tip sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleInput {
    /// `u_tip`: depth along the path since the tip met the membrane; negative before it.
    pub depth_m: f64,
    /// Filtered tip velocity along the path, `v.r`: positive inwards.
    pub speed_along_m_per_s: f64,
    /// Filtered `|v|`.
    pub speed_m_per_s: f64,
    /// The tip's motion in this tick, in world.
    pub tip_step_m: Vector3<f64>,
}

/// Outcome of one tick of the needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleOutput {
    /// Interaction of needle and tissue.
    pub phase: Phase,
    /// The membrane gave way in this tick.
    pub puncture: bool,
    /// Part of the tip's step that the held element takes, in 0..=1.
    pub transmission: f64,
    /// The held element's step, in world.
    pub held_step_m: Vector3<f64>,
}

/// State of one membrane.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct NeedleState {
    /// Phase of the last tick.
    pub phase: Phase,
    /// Set while the membrane is open.
    pub punctured: bool,
    /// Number of membranes that gave way.
    pub punctures: u32,
}

/// Advances the needle by one tick. Input that is not finite holds the needle and moves nothing.
pub fn step(parameters: &NeedleParameters, state: &mut NeedleState, input: &NeedleInput) -> NeedleOutput {
    let finite = input.depth_m.is_finite()
        && input.speed_along_m_per_s.is_finite()
        && input.speed_m_per_s.is_finite()
        && input.tip_step_m.iter().all(|x| x.is_finite());
    let puncture = finite && crosses_membrane(parameters, state, input.depth_m);
    state.phase = if finite {
        phase(parameters, state, input)
    } else {
        Phase::Hold
    };
    // A whole membrane springs back with the tip it rests on; K_ret is for a shaft that slides.
    let rests_on_tip = state.phase == Phase::Retraction && !state.punctured;
    let transmission = if !finite {
        0.0
    } else if rests_on_tip {
        1.0
    } else {
        transmission(state.phase, input.speed_m_per_s, input.depth_m, parameters)
    };
    NeedleOutput {
        phase: state.phase,
        puncture,
        transmission,
        held_step_m: if finite {
            input.tip_step_m * transmission
        } else {
            Vector3::zeros()
        },
    }
}

/// Returns whether the tip crosses `u_cri`, which happens once; the membrane closes when the tip is clear of it.
fn crosses_membrane(parameters: &NeedleParameters, state: &mut NeedleState, depth_m: f64) -> bool {
    if state.punctured {
        state.punctured = depth_m > -parameters.hysteresis_m;
        return false;
    }
    state.punctured = depth_m >= parameters.puncture_depth_m;
    state.punctures = state.punctures.wrapping_add(u32::from(state.punctured));
    state.punctured
}

fn phase(parameters: &NeedleParameters, state: &NeedleState, input: &NeedleInput) -> Phase {
    let outside_m = if state.punctured { -parameters.hysteresis_m } else { 0.0 };
    if input.depth_m <= outside_m {
        Phase::Outside
    } else if input.speed_along_m_per_s.abs() <= parameters.hold_speed_m_per_s {
        Phase::Hold
    } else if input.speed_along_m_per_s < 0.0 {
        Phase::Retraction
    } else if state.punctured {
        Phase::Penetration
    } else {
        Phase::Contraction
    }
}

/// Returns the share of the tip's step that the held element follows, in 0..=1 (paper eq. 6).
///
/// In `Hold` the tissue sticks to the needle, so it follows what little the tip creeps; the steps of a
/// trembling tip then sum to nothing. The depth past `u_cri` does not count below zero.
///
/// ```
/// use stylet_sim::needle::{NeedleParameters, Phase, transmission};
/// let p = NeedleParameters::default();
/// let deep = p.puncture_depth_m + p.depth_coefficient_m2.sqrt();
/// assert_eq!(transmission(Phase::Contraction, 0.5, 1e-3, &p), 1.0);
/// assert!((transmission(Phase::Penetration, 0.0, deep, &p) - (-1f64).exp()).abs() < 1e-12);
/// ```
pub fn transmission(phase: Phase, speed_m_per_s: f64, depth_m: f64, parameters: &NeedleParameters) -> f64 {
    let ratio = match phase {
        Phase::Outside => 0.0,
        Phase::Contraction => 1.0,
        Phase::Penetration => {
            let excess = (speed_m_per_s - parameters.static_speed_m_per_s).max(0.0);
            let past = (depth_m - parameters.puncture_depth_m).max(0.0);
            let exponent = excess * excess / parameters.speed_coefficient_m2_per_s2
                + past * past / parameters.depth_coefficient_m2;
            (-exponent).exp()
        }
        Phase::Retraction => parameters.retraction_ratio,
        Phase::Hold => 1.0,
    };
    if ratio.is_finite() { ratio.clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests;
